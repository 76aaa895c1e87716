// Which medium a ray is in, before and after a surface. Where solids nest or touch, a bit mask of
// the solids a ray is inside of decides: the highest bit (priority) is the medium [Schmidt and
// Budge 2002]. Otherwise the geometric normal alone says it.

#include "lib/scene.glsl"

// The solids that a ray is inside of.
struct MediumStack {
    uint mask;  // one bit a solid that nests or touches others
    uint object;  // the solid that stands alone, NONE: none
};

// What a surface separates.
struct MediumInterface {
    uint before;  // object whose medium the ray comes from, NONE: air
    uint after;  // object whose medium lies behind
    MediumStack behind;  // of a ray that goes through
    bool changes;  // false: another solid of higher priority covers this surface
    bool thin;  // `after` is a sheet's glass alone: behind it is what is before it
};

const uint stack_objects[STACK_SIZE] = STACK_OBJECTS;

uint medium_of(uint mask) { return mask == 0u ? NONE : stack_objects[findMSB(mask)]; }

bool is_inside(MediumStack stack) {
    return MEDIUM_STACK ? stack.mask != 0u || stack.object != NONE : stack.object != NONE;
}

// Object whose medium fills the place, NONE: air.
uint current_medium(MediumStack stack) {
    if (MEDIUM_STACK && stack.mask != 0u) return medium_of(stack.mask);
    return stack.object;
}

uint medium_weight_row(MediumStack stack) {
    uint object = current_medium(stack);
    return object == NONE ? NONE : object_at(object).weight_row;
}

MediumInterface cross_boundary(MediumStack stack, uint object, bool entering) {
    MediumInterface boundary;
    boundary.behind = MediumStack(stack.mask, entering ? object : NONE);
    boundary.before = entering ? NONE : object;
    boundary.after = entering ? object : NONE;
    boundary.changes = true;
    if (HAS_SHEET) {
        boundary.thin = object_at(object).kind == KIND_SHEET;
        if (boundary.thin) {
            boundary.behind = stack;
            boundary.before = current_medium(stack);
            boundary.after = object;
            return boundary;
        }
    }
    if (MEDIUM_STACK) {
        uint bit_index = object_at(object).stack_bit;
        if (bit_index != NONE) {
            uint bit = 1u << bit_index;
            uint mask_before = entering ? stack.mask & ~bit : stack.mask | bit;
            boundary.behind = MediumStack(entering ? stack.mask | bit : stack.mask & ~bit, stack.object);
            boundary.before = medium_of(mask_before);
            boundary.after = medium_of(boundary.behind.mask);
            boundary.changes = boundary.before != boundary.after;
        }
    }
    return boundary;
}

// Refractive index at x of an object's medium (NONE: air, 1).
float medium_index(uint object, float x) {
    uint medium = object_at(object == NONE ? 0u : object).medium;
    return object == NONE ? 1.0 : spectral_row(uint(INDEX_ROW) + (object == NONE ? 0u : medium), x);
}

// Indices before and behind a surface at three places of the spectrum.
void interface_indices(MediumInterface boundary, vec3 x, out vec3 n_i, out vec3 n_t) {
    if (MEDIUM_STACK || HAS_SHEET) {
        n_i = vec3(
            medium_index(boundary.before, x.x), medium_index(boundary.before, x.y), medium_index(boundary.before, x.z));
        n_t = vec3(
            medium_index(boundary.after, x.x), medium_index(boundary.after, x.y), medium_index(boundary.after, x.z));
    } else {
        // One side is air.
        bool entering = boundary.before == NONE;
        uint glass = entering ? boundary.after : boundary.before;
        vec3 n = vec3(medium_index(glass, x.x), medium_index(glass, x.y), medium_index(glass, x.z));
        n_i = entering ? vec3(1.0) : n;
        n_t = entering ? n : vec3(1.0);
    }
}

#ifdef HAS_SHEET
#define IS_THIN(boundary) boundary.thin
#define OF_SHEET(boundary, reflection) (boundary.thin ? both_faces(reflection) : reflection)
#define GO_STRAIGHT(boundary, theta, n_i, n_t, cosine2) \
    if (boundary.thin) { \
        n_t = n_i; \
        cosine2 = theta * theta; \
    }
#else
#define IS_THIN(boundary) false
#define OF_SHEET(boundary, reflection) reflection
#define GO_STRAIGHT(boundary, theta, n_i, n_t, cosine2)
#endif

// Of a crystal, or of a polariser.
Crystal crystal_at(uint texel) {
    uint at = uint(CRYSTALS_AT) + texel;
    return Crystal_FROM(scene_texel, at);
}

// Texel of the crystal that an object is of; NONE: it is isotropic.
uint crystal_of(uint object) {
    if (object == NONE) return NONE;
    Object thing = object_at(object);
    return thing.kind == KIND_DIELECTRIC ? thing.receiver : NONE;
}

bool meets_crystal(MediumInterface boundary) {
    bool solid = boundary.changes && !IS_THIN(boundary);
    return solid && (crystal_of(boundary.before) != NONE || crystal_of(boundary.after) != NONE);
}

// d(index) / d(variable of group g) of an object's medium: 1 where the variable is its own index.
float index_slope(uint object, uint g, float x) {
    if (object == NONE || object_at(object).group != g) return 0.0;
    return MERGED_GROUPS ? spectral_row(uint(SLOPE_ROW) + object_at(object).medium, x) : 1.0;
}

// d(n_i / n_t) / d(variable of group g) [physics: -eta/n_t for the transmitting glass, 1/n_t for the
// incident one].
float index_ratio_derivative(MediumInterface boundary, uint g, float x, float n_i, float n_t) {
    if (IS_THIN(boundary)) return 0.0;
    return index_slope(boundary.before, g, x) / n_t - n_i / (n_t * n_t) * index_slope(boundary.after, g, x);
}
