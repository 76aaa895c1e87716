// Running sums of every light under every reflectance at equally spaced x, and their densities, as programs that splat
// read them (gpu/splat_tables.py); for pictures in motion.
layout(local_size_x = 64) in;

#include "lib/running_sums.glsl"

layout(std430, binding = 2) restrict buffer Bands { float bands[]; };
layout(std430, binding = 3) writeonly restrict buffer Densities { vec4 densities[]; };
layout(std430, binding = 4) writeonly restrict buffer Curves { vec4 curves[]; };
uniform uint first_power;  // floats before the powers

void main() {
    uint at = gl_GlobalInvocationID.x, row = gl_WorkGroupID.y;
    if (at >= uint(SAMPLES)) return;
    vec4 below = sum_below(row, float(at) / float(SAMPLES - 1));
    curves[row * uint(SAMPLES) + at] = below;
    bands[first_power + row * uint(SAMPLES) + at] = below.w;
    if (at >= uint(CELLS)) return;
    vec4 held = smooth_below(row, float(at + 1u) / float(CELLS)) - smooth_below(row, float(at) / float(CELLS));
    for (int line = 0; line < SUM_LINES; ++line)
        if (min(int(line_x(line) * float(CELLS)), CELLS - 1) == int(at)) held += line_energy(row, line);
    densities[row * uint(CELLS) + at] = held * float(CELLS);
}
