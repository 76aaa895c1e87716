// Spectra as splats see them (gpu/splat_tables.py), written on the device for pictures in motion: one target, bands of
// any light under any reflectance. A work group makes one row of one band: its light convolved with a Gaussian.
layout(local_size_x = WIDTH) in;

#include "lib/running_sums.glsl"

struct BandSpan {
    vec2 ends;  // x
    uint row;  // of the running sums
    uint there;
};
layout(std430, binding = 2) readonly restrict buffer Spans { BandSpan spans[]; };
// Standard deviation over sweep length, and cells of the band, of each row.
layout(std430, binding = 3) readonly restrict buffer Widths { vec2 widths[]; };
layout(std430, binding = 4) restrict buffer Bands { vec4 bands[]; };
layout(std430, binding = 5) writeonly restrict buffer Integrals { vec4 integrals[]; };
layout(rgba32f, binding = 0) writeonly uniform restrict image2DArray table;

shared vec4 mass[FINEST];
shared vec4 energy_of[WIDTH], first_of[WIDTH], second_of[WIDTH];

float xi_of(uint sample_index) { return (2.0 * float(sample_index) + 1.0) / float(WIDTH) - 1.0; }

// Gaussian of standard deviation `blur` about `place`, at one sample of a row.
float gaussian(uint sample_index, float sigma, float place, float blur) {
    float away = (0.5 + (0.5 + CUT * sigma) * xi_of(sample_index) - place) / blur;
    return exp(-0.5 * away * away);
}

// What makes its samples' mean over xi in [-1, 1] a whole.
float inverse_integral(float sigma, float place, float blur) {
    float sum = 0.0;
    for (uint k = 0u; k < uint(WIDTH); ++k) sum += gaussian(k, sigma, place, blur);
    return 0.5 * float(WIDTH) / max(sum, 1e-30);
}

// Place of a line in a band, below 0 for one that is not in it.
float place_in(BandSpan span, float x) {
    float side = span.ends.y - span.ends.x;
    if (side < 1e-9) return abs(x - span.ends.x) < 1e-6 ? 0.5 : -1.0;
    return x > span.ends.x && x <= span.ends.y ? (x - span.ends.x) / side : -1.0;
}

vec4 mean_of(vec4 moments, vec4 energies, float dark) {
    return mix(vec4(dark), moments / max(energies, vec4(1e-30)), greaterThan(energies, vec4(0.0)));
}

void main() {
    uint at = gl_LocalInvocationIndex, row = gl_WorkGroupID.x, band = gl_WorkGroupID.y;
    BandSpan span = spans[band];
    float sigma = widths[row].x, side = span.ends.y - span.ends.x;
    int cells = int(widths[row].y);
    float blur = sqrt(sigma * sigma + 1.0 / (12.0 * float(cells * cells)));
    vec4 energy = vec4(0.0), first = vec4(0.0), second = vec4(0.0);
    for (int cell = int(at); cell < cells; cell += WIDTH) {
        float place = (float(cell) + 0.5) / float(cells);
        vec4 held = smooth_below(span.row, span.ends.x + side * (float(cell + 1) / float(cells)))
            - smooth_below(span.row, span.ends.x + side * (float(cell) / float(cells)));
        energy += held;
        first += place * held;
        second += place * place * held;
        mass[cell] = held * inverse_integral(sigma, place, blur);
    }
    energy_of[at] = energy;
    first_of[at] = first;
    second_of[at] = second;
    barrier();
    vec4 sum = vec4(0.0);
    for (int cell = 0; cell < cells; ++cell)
        sum += gaussian(at, sigma, (float(cell) + 0.5) / float(cells), blur) * mass[cell];
    for (int line = 0; line < SUM_LINES; ++line) {
        float place = place_in(span, line_x(line));
        if (place >= 0.0)
            sum +=
                gaussian(at, sigma, place, sigma) * inverse_integral(sigma, place, sigma) * line_energy(span.row, line);
    }
    uint layers = uint(imageSize(table).z);
    ivec3 texel = ivec3(at, band / layers * gl_NumWorkGroups.x + row, band % layers);
    imageStore(table, texel, span.there != 0u ? sum : vec4(0.0));
    if (row > 0u || at > 0u) return;
    // The finest row knows where in the band its light is.
    for (int other = 1; other < WIDTH; ++other) {
        energy += energy_of[other];
        first += first_of[other];
        second += second_of[other];
    }
    for (int line = 0; line < SUM_LINES; ++line) {
        float place = place_in(span, line_x(line));
        vec4 held = place >= 0.0 ? line_energy(span.row, line) : vec4(0.0);
        energy += held;
        first += place * held;
        second += place * place * held;
    }
    vec4 middle = mean_of(first, energy, 0.5);
    integrals[3u * band] = energy * float(span.there);
    integrals[3u * band + 1u] = middle * float(span.there);
    integrals[3u * band + 2u] =
        sqrt(max(mean_of(second, energy, 0.25) - middle * middle, vec4(0.0))) * float(span.there);
    bands[band] = vec4(span.ends, middle.y, energy.w) * float(span.there);
}
