// From what was summed to the maps that are read, all targets' at once. Windows: what lies in their wider texels (broad
// splats, footprint.comp) is added to the finest, from the widest on, bilinear between texels' centres and a quarter of
// the energy to each texel half as wide. SEAMS, charts: energy that fell into a gutter goes home across the seam, one
// thread a texel in a fixed order, and gutters hold what lies across, for lookups.
#if SEAMS
layout(local_size_x = WORKGROUP) in;
#else
layout(local_size_x = SIDE, local_size_y = SIDE) in;
#endif
layout(rgba32f, binding = 0) readonly uniform image2D total[AT_ONCE];
layout(rgba32f, binding = AT_ONCE) writeonly uniform image2D resolved[AT_ONCE];
uniform int first_target;
uniform uint count;  // work groups; SEAMS: texels
uniform int parts;  // of what there is: bit 0: totals, bit 1: sums, bits from 2 on: scratch textures of so many targets

#if FROM_SUMS
#include "light/splat_sums.glsl"
#elif FROM_SCRATCH
layout(rgba32f, binding = SCRATCH_AT) readonly uniform image2D scratch[AT_ONCE];
#endif

vec4 held_at(ivec2 texel, int target) {
    vec4 held = vec4(0.0);
    if ((parts & 1) != 0) held = imageLoad(total[target], texel);
#if FROM_SUMS
    if ((parts & 2) != 0) held += sums_at(texel, imageSize(total[target]), first_target + target);
#elif FROM_SCRATCH
    if (first_target + target < parts >> 2) held += imageLoad(scratch[target], texel);
#endif
    return held;
}

#if SEAMS
struct Seam {
    ivec2 texel;
    float share;  // of what its home holds
    uint first;  // gutters whose energy the home gets
    ivec2 home;
    uint gutter_count;
    uint unused;
};
layout(std430, binding = 0) readonly buffer Seams { Seam seams[]; };
layout(std430, binding = 1) readonly buffer Gutters { ivec2 gutters[]; };

void main() {
    uint i = (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * uint(WORKGROUP) + gl_LocalInvocationID.x;
    int target = int(gl_WorkGroupID.z);
    if (i >= count) return;
    ivec2 home = seams[i].home;
    vec4 sum = held_at(home, target);
    for (uint k = seams[i].first; k < seams[i].first + seams[i].gutter_count; ++k) sum += held_at(gutters[k], target);
    imageStore(resolved[target], seams[i].texel, seams[i].share * sum);
}
#else
// A tile: where its work groups begin, how many of them lie side by side, wider tiles (and from bit 8 on: of its texels
// so many along a side share a wider one's evenly); then the rectangles (x0, y0, x1, y1) of it and of those.
layout(std430, binding = 0) readonly buffer Tiles { ivec4 tiles[]; };

// Texels of a level that the finer ones of a work group take from, in two turns.
const int PATCH = SIDE / 2 + 2;
shared vec4 patches[2 * PATCH * PATCH];

vec4 of_wider(ivec2 texel, ivec2 first, int turn) {
    vec2 at = (vec2(texel) + 0.5) * 0.5 - 0.5;
    ivec2 corner = ivec2(floor(at));
    vec2 share = at - vec2(corner);
    int i = turn * PATCH * PATCH + (corner.y - first.y) * PATCH + corner.x - first.x;
    vec4 below = mix(patches[i], patches[i + 1], share.x);
    vec4 above = mix(patches[i + PATCH], patches[i + PATCH + 1], share.x);
    return mix(below, above, share.y) * 0.25;
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (group >= count) return;
    int target = int(gl_WorkGroupID.z), at = 0;
    for (int next = tiles[at].w; next > 0 && uint(tiles[next].x) <= group; next = tiles[next].w) at = next;
    ivec4 head = tiles[at];
    int even_parts = head.z >> 8;
    head.z &= 255;
    int own = int(group) - head.x;
    ivec2 corner = SIDE * ivec2(own % head.y, own / head.y);
    int turn = 0;
    for (int level = head.z; level > 0; --level) {
        // What this level's texels are needed for, and what they need themselves.
        ivec2 first = corner, wider_first;
        for (int l = 0; l < level; ++l) first = l == 0 && even_parts > 0 ? first / even_parts : first - 1 >> 1;
        wider_first = first - 1 >> 1;
        ivec4 rect = tiles[at + 1 + level];
        for (int i = int(gl_LocalInvocationIndex); i < PATCH * PATCH; i += SIDE * SIDE) {
            ivec2 texel = clamp(first + ivec2(i % PATCH, i / PATCH), ivec2(0), rect.zw - rect.xy - 1);
            vec4 held = held_at(rect.xy + texel, target);
            if (level < head.z) held += of_wider(texel, wider_first, 1 - turn);
            patches[turn * PATCH * PATCH + i] = held;
        }
        turn = 1 - turn;
        barrier();
    }
    ivec4 rect = tiles[at + 1];
    ivec2 texel = corner + ivec2(gl_LocalInvocationID.xy);
    if (any(greaterThanEqual(texel, rect.zw - rect.xy))) return;
    vec4 held = held_at(rect.xy + texel, target);
    if (even_parts > 0) {
        ivec2 at = texel / even_parts - corner / even_parts;
        held += patches[(1 - turn) * PATCH * PATCH + at.y * PATCH + at.x] / float(even_parts * even_parts);
    } else if (head.z > 0) {
        held += of_wider(texel, corner - 1 >> 1, 1 - turn);
    }
    imageStore(resolved[target], rect.xy + texel, held);
}
#endif
