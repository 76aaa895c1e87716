// Light on receivers, looked up in a texture that begins with records of where each receiver's texels lie
// (app/passes/environment_places.py).
#ifndef RECEIVER_LIGHT_GLSL
#define RECEIVER_LIGHT_GLSL

vec4 receiver_record(sampler2D map, uint i)
{
    // Without a division of integers, which a software renderer does ray by ray.
    int width = textureSize(map, 0).x, row = int((float(i) + 0.5) / float(width)), column = int(i) - row * width;
    row += column < 0 ? -1 : (column >= width ? 1 : 0);
    return texelFetch(map, ivec2(int(i) - row * width, row), 0);
}

// One side of a receiver at a place on its triangle `source`: three channels between texels, the fourth of the texel itself.
vec4 receiver_light(sampler2D map, uint receiver, uint source, vec3 position, bool back)
{
    vec4 head = receiver_record(map, receiver);
    vec4 found = vec4(0.0);
    bool charts = head.z > 0.0;
    uint record = uint(head.x) + (back && head.w > 1.0 ? 3u * uint(head.y) : 0u);
    if (charts) record += 3u * (source + 1u - uint(head.z));
    int windows = charts ? 1 : int(head.y);
    bool lit = head.y > 0.0 && (!back || head.w > 1.0);
    for (int level = 0; level < windows && lit; ++level) {
        vec4 row_u = receiver_record(map, record), row_v = receiver_record(map, record + 1u), rect = receiver_record(map, record + 2u);
        vec2 texel = vec2(dot(row_u.xyz, position) + row_u.w, dot(row_v.xyz, position) + row_v.w);
        bool holds = all(greaterThanEqual(texel, rect.xy)) && all(lessThan(texel, rect.zw));
        record += 3u;
        if (holds || level + 1 == windows) {
            vec2 at = clamp(texel - 0.5, rect.xy, rect.zw - 1.0);
            ivec2 low = ivec2(at), high = min(low + 1, ivec2(rect.zw) - 1);
            vec2 share = at - vec2(low);
            vec4 a = texelFetch(map, low, 0), b = texelFetch(map, ivec2(high.x, low.y), 0);
            vec4 c = texelFetch(map, ivec2(low.x, high.y), 0), d = texelFetch(map, high, 0);
            found.rgb = mix(mix(a.rgb, b.rgb, share.x), mix(c.rgb, d.rgb, share.x), share.y);
            vec2 nearest = step(0.5, share);
            found.a = mix(mix(a.a, b.a, nearest.x), mix(c.a, d.a, nearest.x), nearest.y);
            lit = false;
        }
    }
    return found;
}

#endif
