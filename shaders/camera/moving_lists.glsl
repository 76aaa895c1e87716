// Pixels of a picture in motion that want a program of their own, one number each: from the beginning those that look
// at all they see directly themselves, from the end those that see glass or mirrors.
layout(std430, binding = BIND_MOVING_LISTS) restrict buffer MovingLists {
    uint uneven_count;
    uint specular_count;
    uint unused[2];
    uint uneven_groups[4];  // work groups for them, to be dispatched: x, y, z
    uint specular_groups[4];
    uint pixels[];
};

const uint MOST_GROUPS = 65535u;

// Work groups of `size` that the list needs with its pixel `i`; the same for all pixels of a group.
#define COUNT_GROUPS(groups, i, size) \
    if ((i) % (size) == 0u) { \
        atomicMax(groups[0], min((i) / (size) + 1u, MOST_GROUPS)); \
        atomicMax(groups[1], (i) / (size) / MOST_GROUPS + 1u); \
    }

// Which pixel of the list an invocation of these groups is for.
uint place_on_list() {
    return (gl_WorkGroupID.y * MOST_GROUPS + gl_WorkGroupID.x) * gl_WorkGroupSize.x * gl_WorkGroupSize.y
        + gl_LocalInvocationIndex;
}

// Where the specular pixel `i` is; a coated pixel may be on both lists.
uint specular_place(uint i) { return (COATS ? 2u : 1u) * p.size.x * p.size.y - 1u - i; }

uint specular_pixel(uint i) { return pixels[specular_place(i)]; }
