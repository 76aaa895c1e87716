// Light that a diffuse surface gets from others: directions by the cosine, and what one of them counts beside places
// drawn by their light.

#include "lib/emission.glsl"

// Direction about a unit normal, as likely as its cosine [Pharr, Jakob and Humphreys 2023, section A.5.3].
vec3 cosine_direction(vec3 normal, vec2 unit) {
    vec2 across = concentric_disc(unit);
    vec3 u = normalize(cross(normal, abs(normal.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0)));
    return across.x * u + across.y * cross(normal, u) + sqrt(max(1.0 - dot(across, across), 0.0)) * normal;
}

// Irradiance per radiance that one of a pair counts: a direction by the cosine, and a place drawn with `density` per
// GPU unit² of the surface that lies so far away. Balance heuristic of one sample each [Veach and Guibas 1995]: the
// same whichever of both found it.
float gathered(float cosine, float cosine_there, float distance2, float density) {
    float both = cosine * cosine_there;
    return 3.14159265359 * both / max(both + 3.14159265359 * density * distance2, 1e-30);
}
