// Microfacets whose slopes are those of GGX [Trowbridge and Reitz 1975; Walter et al. 2007] of width alpha: half of all
// are steeper than it. Pure functions; directions and normals are unit vectors.

// Smith's Lambda at a direction whose angle to the surface's normal has this cosine: the share of microfacets that hide
// others from it is Lambda / (1 + Lambda) [Smith 1967].
float smith_lambda(float alpha, float cosine) {
    float tangent2 = (1.0 - cosine) * (1.0 + cosine) / max(cosine * cosine, 1e-12);
    return 0.5 * (sqrt(1.0 + alpha * alpha * max(tangent2, 0.0)) - 1.0);
}

// Density of microfacet normals, per steradian of projected area; exact also where alpha is small.
float microfacet_density(float alpha, vec3 facet) {
    float alpha2 = alpha * alpha, spread = dot(facet.xy, facet.xy) + alpha2 * facet.z * facet.z;
    return alpha2 / (3.14159265359 * spread * spread);
}

// Normal of a microfacet, of those that are seen from `toward`, by two numbers in [0, 1): stretched by the width the
// microfacets are a hemisphere, whose projection is a disc cut to half a moon [Heitz 2018]. In the frame whose first
// axis is the projection of `toward` onto the surface.
vec3 visible_microfacet(vec3 toward, vec3 normal, float width, vec2 u) {
    float cosine = clamp(dot(toward, normal), 0.0, 1.0);
    vec3 along = toward - dot(toward, normal) * normal;
    float sine = length(along);
    if (sine < 1e-5) along = cross(normal, abs(normal.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0));
    along = normalize(along);
    vec2 seen = normalize(vec2(width * sine, cosine));
    float radius = sqrt(u.x), angle = 6.28318530718 * u.y;
    float across = radius * cos(angle), up = radius * sin(angle), moon = 0.5 * (1.0 + seen.y);
    up = mix(sqrt(max(1.0 - across * across, 0.0)), up, moon);
    float out_of = sqrt(max(1.0 - across * across - up * up, 0.0));
    vec3 local =
        vec3(width * (out_of * seen.x - up * seen.y), width * across, max(out_of * seen.y + up * seen.x, 1e-7));
    return normalize(local.x * along + local.y * cross(normal, along) + local.z * normal);
}
