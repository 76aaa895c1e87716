// Intensity of a lamp over directions, bilinear in both angles of a photometric file's table
// (app/model/lights/ies_file.py packs it; app/gpu/scene_buffers.py uploads it).

#include "lib/spot.glsl"

// The tables one after the other. Each: number of vertical angles, of horizontal ones, both lists (rad, ascending),
// then a row of intensities for each horizontal angle.
layout(std430, binding = BIND_PROFILES) readonly restrict buffer Profiles { float profiles[]; };

// Number of the stretch that holds `angle` in an ascending list of `count` at `first`, and how far along it.
uint profile_stretch(uint first, uint count, float angle, out float along) {
    uint low = 0u, high = count - 1u;
    while (high - low > 1u) {
        uint middle = (low + high) >> 1u;
        if (profiles[first + middle] <= angle)
            low = middle;
        else
            high = middle;
    }
    float begin = profiles[first + low];
    // Angles that float32 cannot tell apart are an edge.
    along = clamp((angle - begin) / max(profiles[first + high] - begin, 1e-12), 0.0, 1.0);
    return low;
}

// Share of the peak that the table at `table` has towards the unit `direction`. `axis`, `u`, `v`: where the vertical
// angle is 0, and where the horizontal one is 0 and 90 degrees. Beyond the last vertical angle it goes on as it is
// there: the cone of the light ends it.
float profile_intensity(uint table, vec3 direction, vec3 axis, vec3 u, vec3 v) {
    uint verticals = uint(profiles[table]), horizontals = uint(profiles[table + 1u]);
    uint vertical = table + 2u, horizontal = vertical + verticals, values = horizontal + horizontals;
    // On the axis no horizontal angle is like another, and atan of two zeros is undefined.
    vec2 across = vec2(dot(direction, u), dot(direction, v));
    float turn = across == vec2(0.0) ? 0.0 : atan(across.y, across.x);
    float s, t;
    uint i = profile_stretch(horizontal, horizontals, turn < 0.0 ? turn + 6.28318531 : turn, s);
    uint j = profile_stretch(vertical, verticals, angle_between(direction, axis), t);
    uint low = values + i * verticals + j, high = low + verticals;
    return mix(mix(profiles[low], profiles[low + 1u], t), mix(profiles[high], profiles[high + 1u], t), s);
}
