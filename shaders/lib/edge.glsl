// Where a light's emission ends at a hard edge: how far a lattice point lies inside of it, and what its footprint
// keeps. Footprints about the points that a border leaves of a lattice add up to a comb; about all points, each cut off
// where the light ends, they add up to that border. Pure functions, no bindings.

#include "lib/gaussian.glsl"

// Standard deviation of what a lattice point stands for, spacings: about that of a footprint (NARROWED in
// app/passes/footprint.py).
const float EDGE_SPREAD = 0.42;
// Spacings: of points farther outside next to nothing is left (0.9 %), and points farther inside know no edge.
const float EDGE_REACH = 1.0;
// The packed word: a direction and a distance, 12 bits each. 0: no edge.
const float EDGE_STEPS = 4096.0;

// Distance to the edge in spacings, from what `inside` of it (positive, in any unit) and its `change` per spacing along
// both axes are.
float spacings_inside(float inside, vec2 change) { return inside / max(length(change), 1e-30); }

// Share of what a point stands for that lies on the lit side, so many spacings from the edge.
float lit_share(float spacings) {
    return spacings <= -EDGE_REACH ? 0.0
        : spacings >= EDGE_REACH   ? 1.0
                                   : 0.5 + 0.5 * erf_approx(spacings * SQRT_HALF / EDGE_SPREAD);
}

// `spacings` inside of an edge, which is nearest along -`change`.
uint packed_edge(float spacings, vec2 change) {
    if (abs(spacings) >= EDGE_REACH || dot(change, change) <= 0.0) return 0u;
    float turn = fract(atan(change.y, change.x) * 0.15915494 + 1.0);
    uint direction = uint(round(turn * EDGE_STEPS)) & 4095u,
         distance = 1u + uint((spacings / EDGE_REACH + 1.0) * 0.5 * (EDGE_STEPS - 1.0));
    return direction << 12u | distance;
}

// Change of the distance per spacing along both axes, a unit vector (0 where there is no edge), and the distance.
vec3 unpacked_edge(uint word) {
    if (word == 0u) return vec3(0.0);
    float turn = 6.2831853 * float(word >> 12u) / EDGE_STEPS;
    return vec3(cos(turn), sin(turn), EDGE_REACH * ((2.0 * float(word & 4095u) - 1.0) / (EDGE_STEPS - 1.0) - 1.0));
}
