// What a band's splat has of its photon's throughput, channel by channel. Pure functions.
#include "lib/gaussian.glsl"

// Part of a splat's variance along its sweep that is the sweep's own, that of an even one over `xi_half` to both sides;
// the rest blurs it, by 1 / (sqrt(2) inverse_sigma_xi).
float sweeps_part(float xi_half, float inverse_sigma_xi) {
    float ratio = xi_half * inverse_sigma_xi;
    ratio *= ratio * (2.0 / 3.0);
    return ratio / (1.0 + ratio);
}

// Straight on both sides of the anchor. `throughput`: its place; what it is there; its slopes below and above.
vec4 throughput_over(vec4 place, vec4 throughput) {
    vec4 aside = place - throughput.x;
    return throughput.y + min(aside, 0.0) * throughput.z + max(aside, 0.0) * throughput.w;
}

// What the bend at the anchor adds to it in the mean over light about `middle` with such a standard deviation, normally
// distributed.
vec4 mean_bend(vec4 middle, vec4 spread, vec4 throughput) {
    vec4 aside = middle - throughput.x, width = max(spread, 1e-6);
    vec4 beyond = vec4(normal_excess(abs(aside.x) / width.x), normal_excess(abs(aside.y) / width.y),
        normal_excess(abs(aside.z) / width.z), normal_excess(abs(aside.w) / width.w));
    return (throughput.w - throughput.z) * width * beyond;
}
