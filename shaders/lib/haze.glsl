// A beam of light in thin haze, as a ray of the camera crosses it. Pure functions.

// Half the width of `blur_1d`, standard deviations: the square root of seven.
#define BLUR_REACH 2.6457513

// Share of what is scattered that goes each way, 1/sr; g: mean cosine [Henyey and Greenstein 1941].
float henyey_greenstein(float cosine, float g) {
    float d = max(1.0 + g * g - 2.0 * g * cosine, 1e-6);
    return (1.0 - g * g) / (12.566370614 * d * sqrt(d));
}

// Density of a beam's light at a distance from its axis, its integral 1: (1 - r²)², without an edge and without wide
// tails.
float blur_1d(float distance, float deviation) {
    float r = distance / (BLUR_REACH * deviation), q = max(1.0 - r * r, 0.0);
    return 0.9375 * q * q / (BLUR_REACH * deviation);
}

struct BeamCrossing {
    vec3 across;  // unit, along the common perpendicular
    float offset;  // of the beam's axis from the ray, along it
    float on_beam;  // from the beam's start, and from the ray's, to where they are nearest
    float on_ray;
    float cosine;  // between both directions
    float sine;
};

// `start`: of the beam, as seen from the ray's start.
BeamCrossing cross_beam(vec3 start, vec3 beam, vec3 ray) {
    BeamCrossing found;
    vec3 normal = cross(beam, ray);
    float sine2 = max(dot(normal, normal), 1e-8);
    found.sine = sqrt(sine2);
    found.across = normal / found.sine;
    found.cosine = dot(beam, ray);
    found.offset = dot(start, found.across);
    float along_beam = dot(beam, start), along_ray = dot(ray, start);
    found.on_ray = (along_ray - found.cosine * along_beam) / sine2;
    found.on_beam = (found.cosine * along_ray - along_beam) / sine2;
    return found;
}
