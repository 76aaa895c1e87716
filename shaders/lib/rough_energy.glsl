// Light that microfacets throw at each other: paths follow one microfacet only, and what the others would send on after
// all is given back to both its parts alike [Turquin 2019], so that a surface keeps no light. Exact in all for light
// from any one direction; not reciprocal.

#include "lib/scene.glsl"

// One over the share of light, coming at this cosine to the surface's normal, that one microfacet sends on, at three
// places of a band. `table`: the surface's, whose rows are evenly spaced ratios of indices, by logarithm
// (app/model/optics/rough_surfaces.py).
vec3 regained(float table, float cosine, vec3 eta_it) {
    vec3 at = clamp((log(eta_it) / ROUGH_REACH + 1.0) * float(ROUGH_STEPS), 0.0, float(2 * ROUGH_STEPS) - 0.001);
    vec3 sent;
    for (int k = 0; k < 3; ++k) {
        uint row = uint(ROUGH_ROW) + uint(table) + uint(at[k]);
        sent[k] = mix(spectral_row(row, cosine), spectral_row(row + 1u, cosine), fract(at[k]));
    }
    return 1.0 / sent;
}

// What leaves a mirror in all of what one of its microfacets reflects of it, where `thrown` of that meets others, each
// of which reflects as much again.
vec3 reflected_in_all(vec3 reflected, float thrown) { return reflected / (1.0 - thrown * reflected); }
