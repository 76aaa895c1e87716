// Caustic maps as the eye reads them: from a place on a receiver to irradiance. The maps hold
// energy per texel, so that they can be summed and checked; only here it is divided by area.
#ifndef LOOKUP_GLSL
#define LOOKUP_GLSL

layout(std430, binding = BIND_RECEIVERS) readonly restrict buffer Receivers { Receiver receivers[]; };
layout(std430, binding = BIND_PLACEMENTS) readonly restrict buffer Placements { Placement placements[]; };
layout(binding = 0) uniform sampler2D caustic_map[TARGETS];

// Where `position` (GPU space) on triangle `source` of a receiver lies in the atlas: the finest window that
// holds it. False where no map covers it.
bool find_texel(uint receiver, uint source, vec3 position, out uint placement, out vec2 texel)
{
    placement = receivers[receiver].placement;
    texel = vec2(0.0);
    if (placement == NONE) return false;
    if (receivers[receiver].kind == 1u) placement += source - receivers[receiver].first_triangle;
    // At most two windows are nested; a chain of four is more than enough.
    for (int level = 0; level < 4 && placement != NONE; ++level) {
        vec4 row_u = placements[placement].row_u, row_v = placements[placement].row_v;
        vec4 rect = placements[placement].rect;
        texel = vec2(dot(row_u.xyz, position) + row_u.w, dot(row_v.xyz, position) + row_v.w);
        // A chart's rectangle has a gutter, so rounding at its edge must not lose the place.
        float slack = placements[placement].kind == 1u ? 1.0 : 0.0;
        if (all(greaterThanEqual(texel, rect.xy - slack)) && all(lessThan(texel, rect.zw + slack))) return true;
        placement = placements[placement].next;
    }
    return false;
}

// Length of a texel's side, GPU units (maps are near enough square).
float texel_size(uint placement)
{
    return inversesqrt(length(placements[placement].row_u.xyz) * length(placements[placement].row_v.xyz));
}

// Irradiance, the map's unit per scene unit². Bilinear where texels are larger than pixels; nearest
// otherwise, since the pixel's own samples already average and a second blur would soften the caustic.
vec4 caustic_irradiance(int target, uint placement, vec2 texel, bool bilinear)
{
    ivec2 low = ivec2(floor(placements[placement].rect.xy)), high = ivec2(ceil(placements[placement].rect.zw)) - 1;
    float per_area = 1.0 / placements[placement].texel_area;
    if (!bilinear) return texelFetch(caustic_map[target], clamp(ivec2(floor(texel)), low, high), 0) * per_area;
    vec2 at = texel - 0.5;
    ivec2 corner = ivec2(floor(at));
    vec2 share = at - vec2(corner);
    // Clamped, so that the border keeps its own value instead of fading into the neighbouring tile.
    ivec2 a = clamp(corner, low, high), b = clamp(corner + 1, low, high);
    vec4 below = mix(texelFetch(caustic_map[target], a, 0), texelFetch(caustic_map[target], ivec2(b.x, a.y), 0), share.x);
    vec4 above = mix(texelFetch(caustic_map[target], ivec2(a.x, b.y), 0), texelFetch(caustic_map[target], b, 0), share.x);
    return mix(below, above, share.y) * per_area;
}

#endif
