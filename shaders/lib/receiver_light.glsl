// Light on receivers, looked up in a texture that begins with records of where each receiver's texels lie
// (app/passes/environment_places.py).
#include "lib/intersect.glsl"

// Share of a texel's side: what hangs over a receiver nearer than this parts light that interpolation between texels
// would mix.
#define NEAR_TEXELS 0.2
// Texels at the border of a window over which the coarser one below takes over.
#define BLENDED_TEXELS 4.0

vec4 receiver_record(sampler2D map, uint i) {
    // Without a division of integers, which a software renderer does ray by ray.
    int width = textureSize(map, 0).x, row = int((float(i) + 0.5) / float(width)), column = int(i) - row * width;
    row += column < 0 ? -1 : (column >= width ? 1 : 0);
    return texelFetch(map, ivec2(int(i) - row * width, row), 0);
}

// Whether something hangs over a place on a receiver nearer than `reach`, or holds it (`lib/covered.glsl`, or what a
// program knows better).
bool is_covered(sampler2D map, RayOrigin origin, vec3 position, vec3 normal, float reach);

// A receiver's light at a place on its triangle `source`, which `origin` names with the side: three channels between
// texels, the fourth of the texel itself. Of texels that something covers in part the covered and the open part are
// known apart.
vec4 receiver_light(sampler2D map, uint source, RayOrigin origin, vec3 position, vec3 normal) {
    vec4 head = receiver_record(map, object_at(origin.object).receiver);
    vec4 found = vec4(0.0);
    bool charts = head.z > 0.0, back = origin.inside != 0u;
    uint record = uint(head.x) + (back && head.w > 1.0 ? 3u * uint(head.y) : 0u);
    if (charts) record += 3u * (source + 1u - uint(head.z));
    int windows = charts ? 1 : int(head.y);
    // What windows that lie below have left to say.
    float left = head.y > 0.0 && (!back || head.w > 1.0) ? 1.0 : 0.0;
    for (int level = 0; level < windows && left > 0.0; ++level) {
        vec4 row_u = receiver_record(map, record), row_v = receiver_record(map, record + 1u),
             rect = receiver_record(map, record + 2u);
        vec2 texel = vec2(dot(row_u.xyz, position) + row_u.w, dot(row_v.xyz, position) + row_v.w);
        vec2 inward = min(texel - rect.xy, rect.zw - texel);
        float part = level + 1 == windows ? 1.0 : clamp(min(inward.x, inward.y) / BLENDED_TEXELS, 0.0, 1.0);
        record += 3u;
        if (part > 0.0) {
            vec2 at = clamp(texel - 0.5, rect.xy, rect.zw - 1.0);
            ivec2 low = ivec2(at), high = min(low + 1, ivec2(rect.zw) - 1);
            vec2 share = at - vec2(low);
            vec4 a = texelFetch(map, low, 0), b = texelFetch(map, ivec2(high.x, low.y), 0);
            vec4 c = texelFetch(map, ivec2(low.x, high.y), 0), d = texelFetch(map, high, 0);
            vec4 own = vec4(a.a, b.a, c.a, d.a),
                 weights = vec4(1.0 - share.x, share.x, 1.0 - share.x, share.x) * vec4(1.0 - share.yy, share.yy);
            if (left == 1.0) {
                vec2 nearest = step(0.5, share);
                found.a = abs(mix(mix(own.x, own.y, nearest.x), mix(own.z, own.w, nearest.x), nearest.y));
            }
            if (any(lessThan(floatBitsToInt(own), ivec4(0)))) {
                // The covered parts, and how much of each texel is which, lie in the lower half. Windows reach beyond
                // what stands over them: whatever a coarser one is asked about is open.
                ivec2 below = ivec2(0, textureSize(map, 0).y >> 1);
                bool covered = level == 0
                    && is_covered(map, origin, position, normal, NEAR_TEXELS * inversesqrt(dot(row_u.xyz, row_u.xyz)));
                vec4 both = vec4(texelFetch(map, low + below, 0).a, texelFetch(map, ivec2(high.x, low.y) + below, 0).a,
                    texelFetch(map, ivec2(low.x, high.y) + below, 0).a, texelFetch(map, high + below, 0).a);
                vec4 parts = floor(both * 0.0078125);
                if (covered) parts = both - 128.0 * parts;
                // Read again, not kept while a ray looked up.
                if (!covered) below = ivec2(0);
                a = texelFetch(map, low + below, 0);
                b = texelFetch(map, ivec2(high.x, low.y) + below, 0);
                c = texelFetch(map, ivec2(low.x, high.y) + below, 0);
                d = texelFetch(map, high + below, 0);
                vec4 known = weights * parts;
                float sum = dot(known, vec4(1.0));
                weights = sum > 0.0 ? known / sum : weights;
            }
            found.rgb += left * part * (weights.x * a.rgb + weights.y * b.rgb + weights.z * c.rgb + weights.w * d.rgb);
            left *= 1.0 - part;
        }
    }
    return found;
}
