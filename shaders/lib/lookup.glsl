// Caustic maps as the camera reads them: from a place on a receiver to irradiance. The maps hold
// energy per texel, so that they can be summed and checked; only here it is divided by area.
#include "lib/placement.glsl"

#define RECEIVER_CHARTS 1u
#define PLACED_CHART 1u
#define PLACED_PICTURE 2u

layout(std430, binding = BIND_RECEIVERS) readonly restrict buffer Receivers { Receiver receivers[]; };
layout(std430, binding = BIND_PLACEMENTS) readonly restrict buffer Placements { Placement placements[]; };
layout(binding = 0) uniform sampler2D caustic_map[MAP_TARGETS];

// Where `position` (GPU space) on triangle `source` of a receiver lies in the atlas: the finest window that
// holds it, and its texel times its weight (`homogeneous_texel`). False where no map covers it.
bool find_texel(uint receiver, uint source, vec3 position, out uint placement, out vec3 at) {
    placement = receivers[receiver].placement;
    at = vec3(0.0, 0.0, 1.0);
    if (placement == NONE) return false;
    if (CHARTS && receivers[receiver].kind == RECEIVER_CHARTS) placement += source - receivers[receiver].first_triangle;
    // At most two windows are nested; a chain of four is more than enough.
    for (int level = 0; level < 4 && placement != NONE; ++level) {
        Placement window = placements[placement];
        vec4 rect = window.rect;
        at = homogeneous_texel(window, position);
        vec2 texel = at.xy / at.z;
        float slack = 0.0;
        if (CHARTS) {
            // A chart's rectangle has a gutter, so rounding at its edge must not lose the place.
            slack = window.kind == PLACED_CHART ? 1.0 : 0.0;
        }
        if (at.z > 0.0 && all(greaterThanEqual(texel, rect.xy - slack)) && all(lessThan(texel, rect.zw + slack)))
            return true;
        placement = window.next;
    }
    return false;
}

// The map's unit per texel: the mean of the map's texels over a box with these sides
// (at most one texel), so that a pixel's samples together weigh every texel by its share of the pixel.
// A side of one texel is bilinear interpolation. `map` is one of `caustic_map`, by a constant index: a software
// renderer takes a computed one from a lane that may be asleep.
vec4 caustic_energy(sampler2D map, uint placement, vec2 texel, vec2 box) {
    ivec2 low = ivec2(floor(placements[placement].rect.xy)), high = ivec2(ceil(placements[placement].rect.zw)) - 1;
    vec2 side = clamp(box, 1e-4, 1.0);
    vec2 from = texel - 0.5 * side, to = texel + 0.5 * side;
    vec2 border = floor(to);
    vec2 share = clamp((to - border) / side, 0.0, 1.0);
    ivec2 a = ivec2(floor(from)), b = ivec2(border);
    // Clamped, so that the border keeps its own value instead of fading into the neighbouring tile.
    a = clamp(a, low, high);
    b = clamp(b, low, high);
    vec4 below = mix(texelFetch(map, a, 0), texelFetch(map, ivec2(b.x, a.y), 0), share.x);
    vec4 above = mix(texelFetch(map, ivec2(a.x, b.y), 0), texelFetch(map, b, 0), share.x);
    return mix(below, above, share.y);
}
