// A swept splat whose band was cut at total internal reflection, so that no table was made for it: the sum of a few pieces of
// the band, each of one colour (from the running integral over x, so that all energy is there) and each no longer than half the blur.
#include "lib/gaussian.glsl"

layout(std140, binding = 0) uniform DrawParameters {
    vec2 atlas_size;
    vec2 table_u;
    uint bands;
    uint density_cells;
    uint cumulative_samples;
    uint reserved;
};
layout(std430, binding = 7) readonly buffer Curves { vec4 curve[]; };

const float SQRT_TWO = 1.41421356;
const int MIN_PIECES = 4;
const int MAX_PIECES = 24;

flat in vec4 rect;
noperspective in vec3 at;
flat in vec3 shape;
flat in vec4 throughput;
flat in vec4 band;  // x_lo, x_hi, half of the sweep in xi, 1 / (sqrt(2) sigma) in xi
flat in float curve_row;
layout(location = 0) out vec4 deposited[TARGETS];

vec4 energy_below(uint row, float x) {
    float place = clamp(x, 0.0, 1.0) * float(cumulative_samples - 1u);
    uint i = min(uint(place), cumulative_samples - 2u);
    uint base = row * cumulative_samples + i;
    return mix(curve[base], curve[base + 1u], place - float(i));
}

void main() {
    bvec4 within = bvec4(greaterThan(gl_FragCoord.xy, rect.xy), lessThan(gl_FragCoord.xy, rect.zw));
    float share = !all(within) ? 0.0 : gaussian_box(at.x, shape.x) / (2.0 * band.z);
    float sweep_to_sigma = 2.0 * SQRT_TWO * band.z * band.w;
    int pieces = clamp(int(ceil(2.0 * sweep_to_sigma)), MIN_PIECES, MAX_PIECES);
    float length_xi = 2.0 * band.z / float(pieces);
    float length_x = (band.y - band.x) / float(pieces);

    vec4 below[TARGETS];
    for (int g = 0; g < TARGETS; ++g) {
        below[g] = energy_below(uint(curve_row) + uint(g), band.x);
        deposited[g] = vec4(0.0);
    }
    float erf_below = erf_approx((-band.z - at.y) * band.w);
    for (int piece = 1; piece <= pieces; ++piece) {
        float x = band.x + float(piece) * length_x;
        float erf_here = erf_approx((-band.z + float(piece) * length_xi - at.y) * band.w);
        float middle = x - 0.5 * length_x - throughput.x;
        float weight = throughput.y + min(middle, 0.0) * throughput.z + max(middle, 0.0) * throughput.w;
        weight *= share * 0.5 * (erf_here - erf_below) * float(pieces);
        erf_below = erf_here;
        for (int g = 0; g < TARGETS; ++g) {
            vec4 here = energy_below(uint(curve_row) + uint(g), x);
            deposited[g] += weight * (here - below[g]);
            below[g] = here;
        }
    }
}
