// No pixel of any block is chosen.
layout(local_size_x = 8, local_size_y = 8) in;

#include "camera/moving.glsl"

layout(r32ui, binding = IMAGE_CHOSEN) uniform writeonly restrict uimage2D chosen;

void main() {
    uvec2 block = gl_GlobalInvocationID.xy;
    if (all(lessThan(block, m.blocks))) imageStore(chosen, ivec2(block), uvec4(NONE));
}
