// Lists the chosen pixels, with nothing found yet; and what those round them will ask of each, once for all of these.
layout(local_size_x = 8, local_size_y = 8) in;

#include "camera/moving.glsl"

layout(r32ui, binding = IMAGE_CHOSEN) uniform readonly restrict uimage2D chosen;
layout(rgba32f, binding = IMAGE_PICTURE) uniform writeonly restrict image2D found;
layout(rgba32f, binding = IMAGE_FACING) uniform writeonly restrict image2D facing;
#include "camera/listed.glsl"

void main() {
    uvec2 block = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(block, m.blocks))) return;
    uint best = imageLoad(chosen, ivec2(block)).x;
    if (best != NONE) {
        uint number = bitfieldExtract(best, 0, NUMBER_BITS);
        uvec2 pixel = pixel_of(number), first = seen_first(pixel);
        imageStore(found, ivec2(pixel), vec4(0.0));
        imageStore(facing, ivec2(block), vec4(facing_of(first, pixel), uintBitsToFloat(first.y)));
        list_entry(listed_entry(number, THE_SAMPLE, 1u));
    }
}
