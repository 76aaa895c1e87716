// Of each block of pixels the one that sees glass or a mirror and lies nearest to the block's middle: it will be
// followed for all.
layout(local_size_x = 64) in;

#include "camera/moving.glsl"
#include "camera/moving_lists.glsl"

layout(r32ui, binding = IMAGE_CHOSEN) uniform restrict uimage2D chosen;

void main() {
    uint at = place_on_list();
    if (at >= specular_count) return;
    uint number = specular_pixel(at);
    uvec2 pixel = pixel_of(number);
    uvec2 block = pixel / m.glass_step;
    vec2 off = vec2(pixel - block * m.glass_step) + 0.5 - 0.5 * float(m.glass_step);
    uint rank = min(uint(31.0 * dot(off, off) * 2.0 / float(m.glass_step * m.glass_step)), 31u);
    imageAtomicMin(chosen, ivec2(block), rank << NUMBER_BITS | number);
}
