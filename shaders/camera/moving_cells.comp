// A picture in motion, the cells between the lattice's points (moving_lattice.comp): of each, whether what
// moving_direct.comp looks up varies slowly all over it. Lists those whose middles have to be looked at as well.
layout(local_size_x = 32, local_size_y = 8) in;

#include "camera/moving.glsl"

// Place in the atlas (of a map along a plane's own axes) over depth, one over depth (both are linear over the picture),
// and which map of which object (`LATTICE_…`).
layout(rgba32f, binding = IMAGE_PLACES) uniform readonly restrict image2D places;
// What two points share where both vary slowly between them; 0: with none.
layout(r32ui, binding = IMAGE_MARKS) uniform readonly restrict uimage2D marks;
// Which map of which object all of a cell shows; NONE where its pixels look themselves.
layout(r32ui, binding = IMAGE_CELLS) uniform writeonly restrict uimage2D cells;
#include "camera/moving_lists.glsl"

uint mark_at(ivec2 point) { return imageLoad(marks, clamp(point, ivec2(0), ivec2(m.lattice) - 1)).x; }

// Whether a point differs from those on both sides of it: what it lies on is so thin that others may have missed it.
bool is_thin(ivec2 point, uint mark) {
    bool across = mark_at(point - ivec2(1, 0)) != mark && mark_at(point + ivec2(1, 0)) != mark;
    return across || (mark_at(point - ivec2(0, 1)) != mark && mark_at(point + ivec2(0, 1)) != mark);
}

void main() {
    ivec2 cell = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(cell, ivec2(m.lattice) - 1))) return;
    uint mark = mark_at(cell), found = NONE;
    bool even = mark != 0u && mark_at(cell + ivec2(1, 0)) == mark && mark_at(cell + ivec2(0, 1)) == mark
        && mark_at(cell + 1) == mark;
    if (even) {
        found = floatBitsToUint(imageLoad(places, cell).w);
        bool alone = false, thin = false;
        // Next to something else, which may reach in between the corners, the cell's middle tells as well …
        for (int i = 0; i < 12; ++i) {
            ivec2 off = (i < 4 ? ivec2(i, 0) : i < 8 ? ivec2(i - 4, 3) : ivec2((i & 1) * 3, 1 + (i - 8) / 2)) - 1;
            uint other = mark_at(cell + off);
            if (other != mark) {
                alone = true;
                thin = thin || is_thin(cell + off, other);
            }
        }
        // … but of something thin it does not tell enough.
        if (alone && !thin) {
            uint place = atomicAdd(uneven_count, 1u);
            pixels[place] = uint(cell.x) | uint(cell.y) << 16;
            COUNT_GROUPS(uneven_groups, place, CELLS_LISTED)
        }
        if (alone) found = thin ? NONE : mark;
    }
    imageStore(cells, cell, uvec4(found));
}
