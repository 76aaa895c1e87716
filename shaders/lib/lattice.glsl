// The emission lattice: golden-ratio Kronecker points of the unit square; which of them make a coarser lattice of the
// same shape, and the frequencies at which it is uneven. Pure functions, no bindings.

#include "lib/random.glsl"

// 2^32 / golden ratio, and 2^32 / (plastic number)^k: badly approximable, so every projection and
// every rectangle's aspect keeps a good shortest vector.
#define GOLDEN 2654435769u
#define PLASTIC_1 3242174889u
#define PLASTIC_2 2447445414u

// Point of the lattice in the unit square: a golden-ratio Kronecker lattice of `count` points,
// shifted by `shift` (modulo 2^32).
vec2 lattice_point(uint i, uint count, uvec2 shift) {
    float along = (float(i) + unit_float(shift.x)) / float(count);
    return vec2(along, kronecker(i, GOLDEN, shift.y));
}

// A third coordinate of a photon of several lattices: even over each of them, wherever on it, and over all together.
float drawn_evenly(uint photon_id, uint lattices, uint shift) {
    return kronecker(photon_id / lattices, 3774877043u, shift + photon_id % lattices * PLASTIC_2);
}

// Point of `count` in the unit square, each with its mirror image in the square's middle: few points on a lamp then
// have their mean in its middle, and what they light is blurred, not moved.
vec2 mirrored_lattice_point(uint i, uint count, uvec2 shift) {
    vec2 unit = vec2(0.5, 1.0) * lattice_point(i >> 1u, (count + 1u) >> 1u, shift);
    return (i & 1u) == 0u ? unit : 1.0 - unit;
}

const float GOLDEN_RATIO = 1.618033989;
const float ROOT_5 = 2.236067977;

// The Fibonacci number F_k whose multiples of the golden ratio make the shortest step of a lattice of `count` points:
// its k. The two shortest after it are those of its neighbours.
float shortest_step(float count) { return max(round(0.5 * log(ROOT_5 * count) / log(GOLDEN_RATIO)), 2.0); }

// From a point to the one F_k after it, in spacings (1 / sqrt(count) of the unit square's sides): F_k / phi - F_(k-1) =
// -(-phi)^-k.
vec2 golden_step(float k, float count) {
    float sign_k = mod(k, 2.0) < 0.5 ? 1.0 : -1.0, power = pow(GOLDEN_RATIO, k);
    return vec2((power - sign_k / power) / (ROOT_5 * sqrt(count)), -sqrt(count) * sign_k / power);
}

// Two of the three lowest frequencies of a lattice of `count` points, cycles a spacing; the third is their sum. The
// reciprocal lattice of one whose cells have area 1 is the same, turned by 90 degrees.
void lattice_frequencies(float count, out vec2 first, out vec2 second) {
    float k = shortest_step(count);
    vec2 shortest = golden_step(k, count), before = golden_step(k - 1.0, count);
    first = vec2(-shortest.y, shortest.x);
    second = vec2(-before.y, before.x);
}

// Point `i` of a lattice of `count` points in two of its three shortest steps, from a corner far outside: neighbours
// differ by one in one of the two. `shift` is that of `lattice_point`. Exact, as sums modulo 2^32 are.
uvec2 lattice_place(uint i, uint count, uint shift) {
    float k = shortest_step(float(count));
    int fibonacci = int(round(pow(GOLDEN_RATIO, k) / ROOT_5)), before = int(round(pow(GOLDEN_RATIO, k - 1.0) / ROOT_5));
    uint turns, part, carry;
    umulExtended(i, GOLDEN, turns, part);
    uaddCarry(part, shift, carry);
    // (i, turns) = a (F_k, F_(k-1)) + b (F_(k-1), F_(k-2)); the determinant is 1 or -1.
    int n = int(i), w = int(turns + carry), sign_k = mod(k, 2.0) < 0.5 ? -1 : 1;
    ivec2 place = sign_k * ivec2((fibonacci - before) * n - before * w, fibonacci * w - before * n);
    return uvec2(place) + 0x10000000u;
}
