// The camera's tables (passes/camera_tables.py), written on the device after an edit.
layout(local_size_x = 64) in;

#if PAIRS
layout(std430, binding = BIND_ROWS) readonly restrict buffer Rows { float rows[]; };
layout(rg32f, binding = 0) writeonly uniform restrict image2D table;
#else
#include "lib/running_sums.glsl"
layout(rgba32f, binding = 0) writeonly uniform restrict image2D table;
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (at.x >= imageSize(table).x) return;
#if PAIRS
    int place = at.y * (imageSize(table).x + 1) + at.x;
    imageStore(table, at, vec4(rows[place], rows[place + 1], 0.0, 0.0));
#else
    // All of the spectrum is between the first sample and the last, a line at 380 nm too.
    vec4 sum = at.x == 0 ? vec4(0.0) : sum_below(uint(at.y), float(at.x) / float(imageSize(table).x - 1));
    imageStore(table, at, sum);
#endif
}
