// Which medium a ray is in, before and after a surface. Where solids nest or touch, a bit mask of
// the solids a ray is inside of decides: the highest bit (priority) is the medium [Schmidt and
// Budge 2002]. Otherwise the geometric normal alone says it.
#ifndef MEDIUM_GLSL
#define MEDIUM_GLSL

#include "lib/scene.glsl"

struct MediumInterface {
    uint before;        // object whose medium the ray comes from, NONE: air
    uint after;         // object whose medium lies behind
    uint mask_after;
    uint object_after;
    bool changes;       // false: another solid of higher priority covers this surface
};

#ifdef MEDIUM_STACK
const uint stack_objects[STACK_SIZE] = STACK_OBJECTS;

uint medium_of(uint mask)
{
    return mask == 0u ? NONE : stack_objects[findMSB(mask)];
}
#endif

bool ray_is_inside(RayRecord ray)
{
#ifdef MEDIUM_STACK
    return ray.inside_mask != 0u || ray.inside_object != NONE;
#else
    return ray.inside_object != NONE;
#endif
}

uint ray_medium(RayRecord ray)
{
#ifdef MEDIUM_STACK
    if (ray.inside_mask != 0u) return medium_of(ray.inside_mask);
#endif
    return ray.inside_object;
}

uint medium_weight_row(RayRecord ray)
{
    uint object = ray_medium(ray);
    return object == NONE ? NONE : object_at(object).weight_row;
}

MediumInterface cross_boundary(RayRecord ray, uint object, bool entering)
{
    MediumInterface crossing;
    crossing.mask_after = ray.inside_mask;
    crossing.object_after = entering ? object : NONE;
    crossing.before = entering ? NONE : object;
    crossing.after = entering ? object : NONE;
    crossing.changes = true;
#ifdef MEDIUM_STACK
    uint bit_index = object_at(object).stack_bit;
    if (bit_index != NONE) {
        uint bit = 1u << bit_index;
        uint mask_before = entering ? ray.inside_mask & ~bit : ray.inside_mask | bit;
        crossing.mask_after = entering ? ray.inside_mask | bit : ray.inside_mask & ~bit;
        crossing.object_after = ray.inside_object;
        crossing.before = medium_of(mask_before);
        crossing.after = medium_of(crossing.mask_after);
        crossing.changes = crossing.before != crossing.after;
    }
#endif
    return crossing;
}

// Refractive index at x of an object's medium (NONE: air, 1).
float medium_index(uint object, float x)
{
    uint medium = object_at(object == NONE ? 0u : object).medium;
    return object == NONE ? 1.0 : spectral_row(uint(INDEX_ROW) + (object == NONE ? 0u : medium), x);
}

// Indices before and behind a surface at three places of the spectrum.
void crossing_indices(MediumInterface crossing, vec3 x, out vec3 n_i, out vec3 n_t)
{
#ifdef MEDIUM_STACK
    n_i = vec3(medium_index(crossing.before, x.x), medium_index(crossing.before, x.y), medium_index(crossing.before, x.z));
    n_t = vec3(medium_index(crossing.after, x.x), medium_index(crossing.after, x.y), medium_index(crossing.after, x.z));
#else
    // One side is air.
    bool entering = crossing.before == NONE;
    uint glass = entering ? crossing.after : crossing.before;
    vec3 n = vec3(medium_index(glass, x.x), medium_index(glass, x.y), medium_index(glass, x.z));
    n_i = entering ? vec3(1.0) : n;
    n_t = entering ? n : vec3(1.0);
#endif
}

#if SPECTRAL_GROUPS > 0
// dn/dvar of an object's glass: 1 where the variable is its own index.
float medium_slope(uint object, float x)
{
#ifdef MERGED_GROUPS
    return spectral_row(uint(SLOPE_ROW) + object_at(object).medium, x);
#else
    return 1.0;
#endif
}

// d(n_i / n_t) / d(variable of group g) [physics: -eta/n_t for the transmitting glass, 1/n_t for the
// incident one].
float index_ratio_derivative(MediumInterface crossing, uint g, float x, float n_i, float n_t)
{
    float derivative = 0.0;
    if (crossing.after != NONE && object_at(crossing.after).group == g)
        derivative -= n_i / (n_t * n_t) * medium_slope(crossing.after, x);
    if (crossing.before != NONE && object_at(crossing.before).group == g)
        derivative += medium_slope(crossing.before, x) / n_t;
    return derivative;
}
#endif

#endif
