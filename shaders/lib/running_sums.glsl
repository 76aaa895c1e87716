// Running integrals of spectra over x (gpu/running_sums.py): straight between the edges of nanometre cells, with a step
// at each emission line.
layout(std430, binding = BIND_KNOTS) readonly restrict buffer Knots { float knots[]; };
layout(std430, binding = BIND_SUMS) readonly restrict buffer Sums { vec4 sums[]; };

// The last knot that x is not below, and which share of its cell is below x.
uint knot_below(float x, out float share) {
    uint low = 0u, high = uint(SUM_KNOTS) - 1u;
    while (high - low > 1u) {
        uint middle = (low + high) / 2u;
        if (knots[middle] <= x)
            low = middle;
        else
            high = middle;
    }
    float span = knots[low + 1u] - knots[low];
    share = span > 0.0 ? clamp((x - knots[low]) / span, 0.0, 1.0) : 1.0;
    return low;
}

// Without lines.
vec4 smooth_below(uint row, float x) {
    float share;
    uint at = row * uint(SUM_KNOTS + SUM_LINES) + knot_below(x, share);
    vec4 below = sums[at], above = sums[at + 1u];
    return mix(below, above, share);
}

float line_x(int line) { return knots[SUM_KNOTS + line]; }

vec4 line_energy(uint row, int line) { return sums[row * uint(SUM_KNOTS + SUM_LINES) + uint(SUM_KNOTS + line)]; }

// Energy up to and with x.
vec4 sum_below(uint row, float x) {
    vec4 sum = smooth_below(row, x);
    for (int line = 0; line < SUM_LINES; ++line)
        if (line_x(line) <= x) sum += line_energy(row, line);
    return sum;
}
