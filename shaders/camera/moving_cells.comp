// Cells between four points of the lattice: which map of which object all of one shows, where points all round it agree on direct light too. Of
// shadows and outlines as thin as a cell some point next to it tells.
layout(local_size_x = 8, local_size_y = 8) in;

#include "camera/moving.glsl"

layout(rgba32f, binding = IMAGE_PLACES) uniform readonly restrict image2D places;
layout(rgba32f, binding = IMAGE_LIGHT) uniform readonly restrict image2D light;
layout(r32ui, binding = IMAGE_CELLS) uniform writeonly restrict uimage2D cells;

void main()
{
    ivec2 cell = ivec2(gl_GlobalInvocationID.xy), last = ivec2(m.lattice) - 1;
    if (any(greaterThan(cell, last))) return;
    uint key = floatBitsToUint(imageLoad(light, cell).w), map = floatBitsToUint(imageLoad(places, cell).w);
    bool even = key != 0u;
    for (int i = 0; i < 16; ++i) {
        ivec2 off = ivec2(i % 4, i / 4) - 1, point = clamp(cell + off, ivec2(0), last);
        bool corner = all(greaterThanEqual(off, ivec2(0))) && all(lessThan(off, ivec2(2)));
        even = even && floatBitsToUint(imageLoad(light, point).w) == key && (!corner || floatBitsToUint(imageLoad(places, point).w) == map);
    }
    imageStore(cells, cell, uvec4(even ? map : NONE));
}
