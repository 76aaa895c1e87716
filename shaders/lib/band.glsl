// What differs over a band of the spectrum, known at three places of it: its lowest wavelength, the anchor that its
// path is traced at, its highest one. And where total internal reflection sets in inside it.

#include "lib/medium.glsl"
#include "lib/optics.glsl"
#include "lib/polarisation.glsl"

// GPU units that a cut may move a path's start.
#define MAX_MOVED_START 0.01
// A column longer than this (GPU units, the glass is about 1) has left the linear regime for good.
#define COLUMN_LIMIT 1e6
// Halvings of half a band: finer than float32 knows where cosines vanish.
#define ONSET_HALVINGS 18

// What weights at the three places of a band have in their mean over it.
#define OVER_BAND vec3(0.25, 0.5, 0.25)

// Weight at a place x of a band, straight between the three known ones.
float band_weight(vec3 band, vec3 weight, float x) {
    float below = clamp((x - band.x) / max(band.y - band.x, 1e-9), 0.0, 1.0);
    float above = clamp((x - band.y) / max(band.z - band.y, 1e-9), 0.0, 1.0);
    return mix(mix(weight.x, weight.y, below), weight.z, above);
}

vec3 band_weights(vec3 band, vec3 weight, vec3 x) {
    return vec3(band_weight(band, weight, x.x), band_weight(band, weight, x.y), band_weight(band, weight, x.z));
}

// State of polarisation at the places x of a band: Stokes parameters times weights are straight between the three known
// ones.
Polarisation band_polarisation(Polarisation state, vec3 band, vec3 weight, vec3 x) {
    vec3 per_weight = 1.0 / max(band_weights(band, weight, x), 1e-30);
    return Polarisation(state.axis, band_weights(band, weight * state.q, x) * per_weight,
        band_weights(band, weight * state.u, x) * per_weight, band_weights(band, weight * state.v, x) * per_weight);
}

// Whether both parts of a cut band may set out again from starts moved by `low` and `high` from the path's own: so far
// that another surface may lie in between they may not. `distance`: to the surface ahead, GPU units.
bool starts_stay_near(vec3 low, vec3 high, float distance) {
    float allowed = min(MAX_MOVED_START, 0.1 * distance);
    return max(dot(low, low), dot(high, high)) < allowed * allowed;
}

// Change of group g's variable from the anchor to x.
float variable_step(uint g, float x, float x_anchor) {
    return spectral_row(uint(VARIABLE_ROW) + g, x) - spectral_row(uint(VARIABLE_ROW) + g, x_anchor);
}

// The place in the band where total internal reflection sets in, in the half whose ends `passes` tells apart. The
// cosine of incidence is `theta` at the anchor, and changes by `dtheta` a unit of each group's variable and besides by
// `straight`, straight in x, to either end.
float total_reflection_onset(
    vec3 band, float theta, float dtheta[SPECTRAL_GROUPS], vec2 straight, MediumInterface boundary, bvec3 passes) {
    bool low_side = passes.x != passes.y;
    float a = low_side ? band.x : band.y, b = low_side ? band.y : band.z;
    bool passes_a = low_side ? passes.x : passes.y;
    float per_reach = 1.0 / max(b - a, 1e-9), straight_end = low_side ? straight.x : straight.y;
    float anchors[SPECTRAL_GROUPS];
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) anchors[g] = spectral_row(uint(VARIABLE_ROW) + uint(g), band.y);
    for (int i = 0; i < ONSET_HALVINGS; ++i) {
        float x = 0.5 * (a + b);
        float theta_x = theta + abs(x - band.y) * per_reach * straight_end;
        for (int g = 0; g < SPECTRAL_GROUPS; ++g)
            theta_x += dtheta[g] * (spectral_row(uint(VARIABLE_ROW) + uint(g), x) - anchors[g]);
        float eta_x = medium_index(boundary.before, x) / medium_index(boundary.after, x);
        bool passes_x = transmitted_cosine2(clamp(theta_x, -1.0, -1e-6), eta_x) > 0.0;
        a = passes_x == passes_a ? x : a;
        b = passes_x == passes_a ? b : x;
    }
    return 0.5 * (a + b);
}
