// A clear coat's lobe: single scattering by GGX microfacets [Walter et al. 2007] with height-correlated shadowing and
// masking [Heitz 2014] and Fresnel's reflectance. Pure functions; directions are unit vectors away from the surface, in
// a frame whose z is its normal.
#include "lib/microfacet.glsl"
#include "lib/optics.glsl"

// A frame round `normal`: its other two axes [Duff et al. 2017].
void axes_across(vec3 normal, out vec3 first, out vec3 second) {
    float side = normal.z >= 0.0 ? 1.0 : -1.0, a = -1.0 / (side + normal.z), b = normal.x * normal.y * a;
    first = vec3(1.0 + side * normal.x * normal.x * a, side * b, -side * normal.x);
    second = vec3(b, side + normal.y * normal.y * a, -normal.y);
}

float coat_fresnel(float cosine, float index) {
    float eta_it = 1.0 / index;
    return fresnel_reflectance(-cosine, eta_it, transmitted_cosine2(-cosine, eta_it));
}

// What is left of light reflected by a facet that was drawn as it is seen: F G2 / G1.
float coat_weight(float alpha, float index, vec3 toward, vec3 away, float facing) {
    float masked = 1.0 + smith_lambda(alpha, toward.z);
    return away.z > 0.0 ? coat_fresnel(facing, index) * masked / (masked + smith_lambda(alpha, away.z)) : 0.0;
}

// Density, per steradian, of the directions that such facets reflect to.
float coat_direction_density(float alpha, vec3 toward, vec3 facet) {
    return microfacet_density(alpha, facet) / (4.0 * toward.z * (1.0 + smith_lambda(alpha, toward.z)));
}

// Radiance that goes to `toward` of light from `from`, per its irradiance across it: the lobe times the cosine of
// incidence.
float coat_response(float alpha, float index, vec3 toward, vec3 from) {
    vec3 facet = normalize(toward + from);
    bool lit = toward.z > 0.0 && from.z > 0.0;
    float seen = 1.0 + smith_lambda(alpha, toward.z) + smith_lambda(alpha, from.z);
    return lit ? coat_fresnel(dot(toward, facet), index) * microfacet_density(alpha, facet) / (4.0 * toward.z * seen)
               : 0.0;
}
