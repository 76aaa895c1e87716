// The camera's tables (passes/camera_tables.py), written on the device after an edit.
layout(local_size_x = 64) in;

#include "lib/running_sums.glsl"
#if PAIRS
// CURVES rows at the knots, then rows of equally spaced samples.
layout(std430, binding = BIND_ROWS) readonly restrict buffer Rows { float rows[]; };
layout(rg32f, binding = 0) writeonly uniform restrict image2D table;

float sample_of(int row, int number, int last) {
    if (row >= CURVES) return rows[CURVES * SUM_KNOTS + (row - CURVES) * (last + 1) + number];
    float share;
    uint at = uint(row * SUM_KNOTS) + knot_below(float(number) / float(last), share);
    return rows[at] + share * (rows[at + 1u] - rows[at]);
}
#else
layout(rgba32f, binding = 0) writeonly uniform restrict image2D table;
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    int width = imageSize(table).x;
    if (at.x >= width) return;
#if PAIRS
    imageStore(table, at, vec4(sample_of(at.y, at.x, width), sample_of(at.y, at.x + 1, width), 0.0, 0.0));
#else
    // All of the spectrum is between the first sample and the last, a line at 380 nm too.
    imageStore(table, at, at.x == 0 ? vec4(0.0) : sum_below(uint(at.y), float(at.x) / float(width - 1)));
#endif
}
