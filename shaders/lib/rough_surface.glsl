// A ground surface: microfacets (`lib/microfacet.glsl`), each of them polished. A path that meets the surface meets one
// of those that it can see [Heitz 2018], and is turned by that one's normal as by any other. What it loses is what
// other microfacets hide of it on its way out [Smith 1967]: light that they throw back into the surface is not followed
// further. Directions and normals are unit vectors, `normal` is the surface's own, turned against the ray.

#include "lib/microfacet.glsl"
#include "lib/random.glsl"

// Two numbers in [0, 1) for the microfacet that a path meets at this depth: Kronecker sequences over paths, whose
// generators are the square roots of primes that no other dimension uses. Deeper ones are hashed.
vec2 microfacet_numbers(uint i, uint depth, uint key) {
    const uint generators[8] =
        uint[](1654270250u, 2438529370u, 355462360u, 1731405415u, 2394180231u, 3675008525u, 1203062813u, 2925498710u);
    uint own = hash_combine(key, depth);
    uint along = depth < 4u ? generators[2u * depth] : hash_pcg(2u * depth + 0x5bd1e995u) | 1u;
    uint across = depth < 4u ? generators[2u * depth + 1u] : hash_pcg(2u * depth + 0x5bd1e996u) | 1u;
    return vec2(kronecker(i, along, own), kronecker(i, across, hash_pcg(own)));
}

// Share of the microfacets of width `width` that none hides from a direction whose angle to the surface's normal has
// this cosine: Smith's G1.
vec3 smith_share(vec3 cosine, float width) {
    vec3 hidden = vec3(smith_lambda(width, min(cosine.x, 1.0)), smith_lambda(width, min(cosine.y, 1.0)),
        smith_lambda(width, min(cosine.z, 1.0)));
    return mix(vec3(0.0), 1.0 / (1.0 + hidden), greaterThan(cosine, vec3(0.0)));
}

// Change of that share per cosine, of itself; the cosine is not 0.
float smith_slope(float cosine, float width) {
    float tangent2 = max((1.0 - cosine) * (1.0 + cosine), 0.0) / (cosine * cosine),
          root = sqrt(1.0 + width * width * tangent2);
    return width * width / ((1.0 + root) * root * cosine * cosine * cosine);
}

// How far a microfacet's normal turns with the surface's own, whose derivative is `dnormal`: as a rigid body would.
vec3 turned_with(vec3 microfacet, vec3 normal, vec3 dnormal) { return cross(cross(normal, dnormal), microfacet); }

// Two derivatives of a microfacet's normal that say how far others reach round it: a standard deviation of the middle
// of GGX, which is that of a Gaussian of half its width, and wider in its tails, where there are fewer.
void lobe_axes(vec3 microfacet, vec3 normal, float width, out vec3 first, out vec3 second) {
    float cosine = dot(microfacet, normal), sine2 = max(1.0 - cosine * cosine, 0.0);
    float spread = 0.5 * sqrt(width * width * cosine * cosine + sine2);
    first = spread * normalize(cross(microfacet, abs(microfacet.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0)));
    second = cross(microfacet, first);
}

// Part of the lobe's axes that one of `count` paths stands for: paths no longer share a microfacet with their
// neighbours, so their number within a kernel grows with its area, and the kernel shrinks as the sixth root of their
// number (the best there is for densities in two dimensions [Silverman 1986]). With the smoothing of splats, 0.45,
// never more than half of the lobe itself.
float lobe_part(float count) { return min(4.4 * pow(max(count, 1.0), -1.0 / 6.0), 1.1); }
