// After a survey: marks the pixels that share their key with all their neighbours (camera/survey.glsl). What is written
// meanwhile is the mark alone, which nobody compares.
layout(local_size_x = 8, local_size_y = 8) in;

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { CameraParameters p; };

#include "camera/listed.glsl"

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy), last = ivec2(p.size) - 1;
    if (any(greaterThan(pixel, last))) return;
    uint at = survey_place(uint(pixel.y) * p.size.x + uint(pixel.x)), key = listed[at] & ~IS_EVEN;
    bool even = key != 0u;
    for (int i = 0; i < 9 && even; ++i) {
        ivec2 beside = clamp(pixel + ivec2(i % 3, i / 3) - 1, ivec2(0), last);
        even = (listed[survey_place(uint(beside.y) * p.size.x + uint(beside.x))] & ~IS_EVEN) == key;
    }
    if (even) listed[at] = key | IS_EVEN;
}
