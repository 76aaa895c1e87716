// Nearest hit of a ray with the scene. Four ways to hold geometry, each compiled in only where
// the scene has it: convex faceted solids as half-spaces, curved ones as quadrics, few loose triangles
// in a loop, many in a tree. Nothing is offset: a ray starts exactly on the surface it left, that facet is excluded
// by its number, and the neighbours of a curved surface by the side the ray is on.
// A program that must know how many rounds its loops run says how they are counted.
#ifndef COUNT_ROUNDS
#define COUNT_ROUNDS(count)
#endif

#include "lib/finite.glsl"
#include "lib/scene.glsl"
#include "lib/optics.glsl"
#include "lib/curved.glsl"

// Set on `Hit.primitive` where it numbers a plane of a half-space solid, not a triangle.
#define PLANE_BIT 0x80000000u
// … a face of a curved solid.
#define CURVED_BIT 0x40000000u
// Distances below this (GPU units) are suspect: the same surface met again, or two that touch.
#define NEAR_DISTANCE 3e-5
#if CONTACTS
// Rays that graze a surface in contact more than this (cosine) are met as if they did not.
#define GRAZING 0.1
// How far a surface that is still to be crossed may lie behind a ray that has met another one in contact with it first.
#define BEHIND (2.5 * NEAR_DISTANCE / GRAZING)
// Surfaces that lean against each other by less (cosine) and touch are one interface.
#define CONTACT_COSINE 0.9
// Error of a distance along a normal, as a share of the place's coordinates.
#define CONTACT_ROUNDING 4e-7
// Of the surface that the ray starts on, unit; zero where it starts on none.
vec3 left_normal = vec3(0.0);
#else
#define BEHIND NEAR_DISTANCE
#endif
#define FAR_DISTANCE 1e30
// A lamp or a camera as near as this lies on a surface: its rays leave it, unless it is glass that they enter.
#define START_DISTANCE 2e-7
// Rays that start farther than this from the middle of the scene are met from nearby.
#define FAR_START 4.0

struct Hit {
    float distance;
    uint primitive;  // slot in `triangles`, PLANE_BIT | plane or CURVED_BIT | face; NONE: nothing was hit
    uint object;
    vec3 normal_g;  // unit, outward
    vec2 bary;  // weights of edge1 and edge2 (triangles only)
};

// Where a ray comes from, so that it does not meet the surface it just left.
struct RayOrigin {
    uint primitive;  // facet it starts on, or NONE
    uint object;  // object of that facet
    uint inside;  // 1: it travels on that object's inner side (no bool: see shaders/README.md)
    uint inside_mask;  // solids of the medium stack it is inside of (see medium.glsl)
};

bool is_plane(uint primitive) { return (primitive & PLANE_BIT) != 0u && primitive != NONE; }

bool is_curved(uint primitive) { return (primitive & (PLANE_BIT | CURVED_BIT)) == CURVED_BIT; }

bool accept_hit(float distance, float facing, uint object, RayOrigin origin) {
    // facing = dot(direction, outward normal): < 0 enters. On the surface just left only the
    // opposite crossing can be true; another object may touch at distance 0.
    bool same = object == origin.object;
    bool repeated = same && distance < NEAR_DISTANCE && ((origin.inside != 0u) == (facing < 0.0));
    // Of two surfaces at one place both lie near for ever; the mask knows which was crossed already.
    if (MEDIUM_STACK && !same && distance < NEAR_DISTANCE) {
        uint bit = object_at(object).stack_bit;
        bool is_inside = bit != NONE && (origin.inside_mask & (1u << (bit & 31u))) != 0u;
        repeated = bit != NONE && is_inside == (facing < 0.0);
    }
    float least = same ? 0.0 : -BEHIND;
    // What is no surface, a lamp or a camera, has nothing in contact with it. No lamp stands in glass: what shines from
    // a face into it enters there, on whichever side of the face rounding has put it.
    if (origin.object == NONE) {
        least = START_DISTANCE;
        if (abs(distance) <= START_DISTANCE && facing < 0.0 && object_at(object).kind == KIND_DIELECTRIC)
            least = -FAR_DISTANCE;
    }
    return !repeated && distance > least;
}

// Touching solids: of two crossings at one place the entering one comes first, so that no film of
// air appears between them.
float crossing_key(float distance, float facing) {
    return MEDIUM_STACK ? (facing > 0.0 ? distance + NEAR_DISTANCE : distance) : distance;
}

// Surfaces in contact are one interface, and what light passes gives way to what it ends at or is thrown back by:
// silver, black or paint on glass is met from within the glass as from outside. Such a sheet lies behind a ray that has
// left it or anything in contact with it. A grating or a thin sheet, which is passed, is only met once. `height`: way
// to the sheet along its own normal; `normal`: unit.
bool accept_sheet(float distance, float height, vec3 normal, uint kind, vec3 origin_p) {
    bool in_contact = abs(dot(normal, left_normal)) > CONTACT_COSINE;
    float rounding = CONTACT_ROUNDING * (2.0 + dot(abs(origin_p), vec3(1.0)));
    return in_contact ? height > (kind >= KIND_GRATING ? NEAR_DISTANCE : rounding) : distance > -NEAR_DISTANCE;
}

// Nobody enters a solid that he is in, nor leaves one that he is not: what says so has been crossed already, in another
// surface's place.
bool crossed_in_contact(float height, float facing, uint stack_bit, RayOrigin origin) {
    bool is_inside = stack_bit != NONE && (origin.inside_mask & (1u << (stack_bit & 31u))) != 0u;
    return stack_bit != NONE && is_inside == (facing < 0.0) && height < 2.0 * NEAR_DISTANCE;
}

// Of two sheets that rounding cannot tell apart everybody meets the same one.
bool comes_first(float key, float cosine, uint object, float best_key, uint best_object) {
    float rounding = CONTACT_ROUNDING * (2.0 + abs(key)) / max(cosine, GRAZING);
    return abs(key - best_key) < rounding && best_object != NONE && object != best_object ? object < best_object
                                                                                          : key < best_key;
}

// Rounding errors of the edge tests, as a share of |edge| (|origin - vertex| + |edge|): three products
// and sums each. Where two facets share an edge at least one accepts the ray, however small they are.
#define EDGE_ERROR 5e-7

// Triangles and boxes are met from the point `near_p` of the ray that comes closest to the middle of
// the scene, `ahead` beyond the ray's own start: a lamp far away then costs no digits, and the
// slack at edges stays that of the glass, not of the distance.
void try_triangle(
    uint slot, vec3 near_p, float ahead, vec3 direction, RayOrigin origin, inout float best_key, inout Hit hit) {
    Triangle facet = triangle_at(slot);
    vec3 to_origin = near_p - facet.vertex;
    vec3 normal = facet_normal(facet.edge1, facet.edge2);
    float facing = dot(direction, normal);
    vec3 q = cross(to_origin, direction);
    float inverse = 1.0 / facing;
    float u = -dot(facet.edge2, q) * inverse;
    float v = dot(facet.edge1, q) * inverse;
    float distance = ahead - dot(to_origin, normal) * inverse;
    float key = crossing_key(distance, facing);
    float edge = sqrt(max(dot(facet.edge1, facet.edge1), dot(facet.edge2, facet.edge2)));
    // Of a facet seen edge-on the bound says nothing any more: no hit lies far outside it.
    float slack = min(EDGE_ERROR * edge * (sqrt(dot(to_origin, to_origin)) + edge) * abs(inverse), 0.1);
    // Of an edge-on or degenerate triangle nothing is finite.
    bool inside =
        is_finite(inverse) && u >= -slack && v >= -slack && u + v <= 1.0 + 2.0 * slack && slot != origin.primitive;
    if (CONTACTS) {
        if (inside) {
            Object thing = object_at(facet.object);
            bool sheet = thing.kind != KIND_DIELECTRIC;
            vec3 unit_normal = normalize(normal);
            float cosine = abs(dot(direction, unit_normal)), height = distance * cosine;
            key = sheet ? distance - NEAR_DISTANCE / max(cosine, GRAZING) : key;
            bool meets = accept_hit(distance, facing, facet.object, origin);
            if (sheet && origin.object != NONE && facet.object != origin.object)
                meets = accept_sheet(distance, height, unit_normal, thing.kind, near_p);
            if (MEDIUM_STACK) meets = meets && !crossed_in_contact(height, facing, thing.stack_bit, origin);
            if (meets && comes_first(key, cosine, facet.object, best_key, hit.object)) {
                best_key = key;
                hit.distance = distance;
                hit.primitive = slot;
                hit.object = facet.object;
                hit.bary = vec2(u, v);
            }
        }
    } else {
        inside = inside && key < best_key;
        if (inside && accept_hit(distance, facing, facet.object, origin)) {
            best_key = key;
            hit.distance = distance;
            hit.primitive = slot;
            hit.bary = vec2(u, v);
        }
    }
}

#define LEAF_BIT 0x80000000u

// Where the ray enters the box, counted from `near_p`; FAR_DISTANCE where it misses.
float box_entry(vec3 low, vec3 high, vec3 near_p, vec3 inverse_direction, float start, float far) {
    vec3 t0 = (low - near_p) * inverse_direction, t1 = (high - near_p) * inverse_direction;
    vec3 tmin = min(t0, t1), tmax = max(t0, t1);
    float enter = max(max(tmin.x, tmin.y), max(tmin.z, start));
    float leave = min(min(tmax.x, tmax.y), min(tmax.z, far));
    // The slack makes the slab test conservative in float32, also behind `near_p` [Ize 2013].
    return enter <= leave + abs(leave) * 4e-7 + 1e-7 ? enter : FAR_DISTANCE;
}

// One for all rays of an invocation.
uint tree_stack[TREE_STACK + 1];

// A node is four texels: both children's boxes, then their links. A link is the number of an inner
// node, or LEAF_BIT | triangles << 28 | first triangle; NONE ends the stack. All rays of a group
// first go down to a leaf each, then test triangles together: where both sides of a branch
// are executed, neither kind of step then pays for the other [Aila and Laine 2009].
void intersect_tree(
    vec3 near_p, float ahead, vec3 direction, RayOrigin origin, bool any_hit, inout float best_key, inout Hit hit) {
    // A zero component would make 0 * inf = NaN on a slab's plane.
    vec3 safe = mix(direction, vec3(1e-20), lessThan(abs(direction), vec3(1e-20)));
    vec3 inverse_direction = 1.0 / safe;
    float start = -BEHIND - ahead;
    tree_stack[0] = NONE;
    int top = 1;
    uint current = 0u;
    while (true) {
        while (current < LEAF_BIT) {
            COUNT_ROUNDS(1);
            uint at = uint(TREE_AT) + 4u * current;
            uvec4 a = scene_texel(at), b = scene_texel(at + 1u), c = scene_texel(at + 2u), links = scene_texel(at + 3u);
            float far = best_key + BEHIND - ahead;
            float enter0 = box_entry(
                uintBitsToFloat(a.xyz), uintBitsToFloat(uvec3(a.w, b.xy)), near_p, inverse_direction, start, far);
            float enter1 = box_entry(
                uintBitsToFloat(uvec3(b.zw, c.x)), uintBitsToFloat(c.yzw), near_p, inverse_direction, start, far);
            bool hit0 = enter0 < FAR_DISTANCE, hit1 = enter1 < FAR_DISTANCE;
            bool swap = enter1 < enter0;
            if (hit0 && hit1) tree_stack[top++] = swap ? links.x : links.y;
            current = swap ? links.y : links.x;
            if (!(hit0 || hit1)) current = tree_stack[--top];
        }
        if (current == NONE) break;
        uint first = current & 0x0fffffffu, end = first + ((current >> 28u) & 7u);
        COUNT_ROUNDS(end - first + 1u);
        for (; first < end; ++first) try_triangle(first, near_p, ahead, direction, origin, best_key, hit);
        if (any_hit && hit.primitive != NONE) break;
        current = tree_stack[--top];
    }
}

// A convex solid is where all half-spaces overlap: enter at the last front plane, leave at the
// first back plane.
void intersect_solid(uint solid, vec3 origin_p, vec3 direction, RayOrigin origin, inout float best_key, inout Hit hit) {
    float enter = -FAR_DISTANCE, leave = FAR_DISTANCE;
    uint enter_plane = NONE, leave_plane = NONE;
    uint first = solids[solid].first_plane, end = first + solids[solid].plane_count;
    COUNT_ROUNDS(end - first + 1u);
    // Most rays miss most solids, and a few planes tell.
    for (uint i = first; i < end && enter <= leave; ++i) {
        vec4 plane = planes[i];
        float facing = dot(direction, plane.xyz);
        float gap = plane.w - dot(origin_p, plane.xyz);
        // A ray that starts on this very plane is at distance 0 from it, whatever rounding says.
        float distance = (PLANE_BIT | i) == origin.primitive ? 0.0 : gap / facing;
        bool front = facing < 0.0 && distance > enter, back = facing > 0.0 && distance < leave;
        enter = front ? distance : enter;
        enter_plane = front ? i : enter_plane;
        leave = back ? distance : leave;
        leave_plane = back ? i : leave_plane;
        leave = facing == 0.0 && gap < 0.0 ? -FAR_DISTANCE : leave;
    }
    uint object = solids[solid].object;
    if (enter <= leave) {
        float key = crossing_key(enter, -1.0);
        if (CONTACTS && MEDIUM_STACK) {
            // A solid in contact with a sheet has a bit.
            uint bit = object_at(object).stack_bit;
            bool crosses_in = enter_plane != NONE
                && !crossed_in_contact(enter * -dot(direction, planes[enter_plane].xyz), -1.0, bit, origin);
            bool crosses_out = leave_plane != NONE
                && !crossed_in_contact(leave * dot(direction, planes[leave_plane].xyz), 1.0, bit, origin);
            enter_plane = crosses_in ? enter_plane : NONE;
            leave_plane = crosses_out ? leave_plane : NONE;
        }
        if (enter_plane != NONE && (PLANE_BIT | enter_plane) != origin.primitive && key < best_key
            && accept_hit(enter, -1.0, object, origin)) {
            best_key = key;
            hit.distance = enter;
            hit.primitive = PLANE_BIT | enter_plane;
            hit.object = object;
        }
        key = crossing_key(leave, 1.0);
        if (leave_plane != NONE && (PLANE_BIT | leave_plane) != origin.primitive && key < best_key
            && accept_hit(leave, 1.0, object, origin)) {
            best_key = key;
            hit.distance = leave;
            hit.primitive = PLANE_BIT | leave_plane;
            hit.object = object;
        }
    }
}

// Curved solids are where all their faces overlap. A ray that has left one has left it for good; one that goes on
// within starts inside.
void intersect_curved(vec3 origin_p, vec3 direction, RayOrigin origin, inout float best_key, inout Hit hit) {
    COUNT_ROUNDS(PIECE_COUNT);
    float enter = -FAR_DISTANCE, leave = FAR_DISTANCE;
    uint enter_face = NONE, leave_face = NONE;
    for (uint i = 0u; i < uint(PIECE_COUNT); ++i) {
        Piece piece = piece_at(i);
        vec2 interval = piece_interval(piece, origin_p, direction);
        if ((CURVED_BIT | i) == origin.primitive) {
            // At its own place a ray is at distance 0, whatever rounding says.
            float chord = max(piece_chord(piece, origin_p, direction), START_DISTANCE);
            interval = origin.inside != 0u ? vec2(-FAR_DISTANCE, chord) : vec2(FAR_DISTANCE, -FAR_DISTANCE);
        }
        enter_face = interval.x > enter ? CURVED_BIT | i : enter_face;
        leave_face = interval.y < leave ? CURVED_BIT | i : leave_face;
        enter = max(enter, interval.x);
        leave = min(leave, interval.y);
        if (piece.is_last != 0u) {
            // Of a solid that is behind, or that the ray passes by, nothing is met.
            bool enters = enter <= leave && enter_face != NONE, leaves = enter <= leave && leave_face != NONE;
            if (CONTACTS && MEDIUM_STACK) {
                uint bit = object_at(piece.object).stack_bit;
                enters = enters
                    && !crossed_in_contact(-height_over(piece_at(enter_face & ~CURVED_BIT), origin_p, direction, enter),
                        -1.0, bit, origin);
                leaves = leaves
                    && !crossed_in_contact(
                        height_over(piece_at(leave_face & ~CURVED_BIT), origin_p, direction, leave), 1.0, bit, origin);
            }
            float key = crossing_key(enter, -1.0);
            if (enters && key < best_key && accept_hit(enter, -1.0, piece.object, origin)) {
                best_key = key;
                hit.distance = enter;
                hit.primitive = enter_face;
                hit.object = piece.object;
            }
            key = crossing_key(leave, 1.0);
            if (leaves && key < best_key && accept_hit(leave, 1.0, piece.object, origin)) {
                best_key = key;
                hit.distance = leave;
                hit.primitive = leave_face;
                hit.object = piece.object;
            }
            enter = -FAR_DISTANCE;
            leave = FAR_DISTANCE;
            enter_face = leave_face = NONE;
        }
    }
}

bool intersect(vec3 origin_p, vec3 direction, float far, RayOrigin origin, bool any_hit, out Hit hit) {
    hit.distance = far;
    hit.primitive = NONE;
    hit.object = NONE;
    hit.normal_g = vec3(0.0);
    hit.bary = vec2(0.0);
    float best_key = far;
    if (CONTACTS) {
        left_normal = vec3(0.0);
        if (origin.primitive != NONE) {
            Triangle left = triangle_at(min(origin.primitive, uint(max(TRIANGLE_COUNT, 1)) - 1u));
            left_normal = normalize(facet_normal(left.edge1, left.edge2));
            if (CONVEX_SOLIDS && is_plane(origin.primitive)) left_normal = planes[origin.primitive & ~PLANE_BIT].xyz;
            if (CURVED_SOLIDS && is_curved(origin.primitive))
                left_normal = normalize(piece_gradient(piece_at(origin.primitive & ~CURVED_BIT), origin_p));
        }
    }
    if (CONVEX_SOLIDS) {
        for (uint i = 0u; i < uint(SOLID_COUNT); ++i) intersect_solid(i, origin_p, direction, origin, best_key, hit);
    }
    if (CURVED_SOLIDS) intersect_curved(origin_p, direction, origin, best_key, hit);
    float ahead = -dot(origin_p, direction);
    ahead = ahead > FAR_START ? ahead : 0.0;
    vec3 near_p = origin_p + ahead * direction;
    if (HAS_TREE) {
        intersect_tree(near_p, ahead, direction, origin, any_hit, best_key, hit);
    } else if (LOOSE_TRIANGLES) {
        COUNT_ROUNDS(TRIANGLE_COUNT);
        for (uint i = 0u; i < uint(TRIANGLE_COUNT); ++i)
            try_triangle(i, near_p, ahead, direction, origin, best_key, hit);
    }
    return hit.primitive != NONE;
}

// The facet of a triangle hit; some triangle where there was none, so that the fetch needs no branch.
Triangle hit_triangle(Hit hit) { return triangle_at(min(hit.primitive, uint(max(TRIANGLE_COUNT, 1)) - 1u)); }

// Nearest hit within `far`; `hit.primitive` is NONE where there is none.
bool intersect_closest(vec3 origin_p, vec3 direction, float far, RayOrigin origin, out Hit hit) {
    bool met = intersect(origin_p, direction, far, origin, false, hit);
    if (LOOSE_TRIANGLES && met && (hit.primitive & (PLANE_BIT | CURVED_BIT)) == 0u) {
        Triangle facet = hit_triangle(hit);
        hit.object = facet.object;
        hit.normal_g = normalize(facet_normal(facet.edge1, facet.edge2));
    }
    if (CONVEX_SOLIDS && met && (hit.primitive & PLANE_BIT) != 0u)
        hit.normal_g = planes[hit.primitive & ~PLANE_BIT].xyz;
    if (CURVED_SOLIDS && is_curved(hit.primitive))
        hit.normal_g =
            normalize(piece_gradient(piece_at(hit.primitive & ~CURVED_BIT), origin_p + hit.distance * direction));
    return met;
}

// Whether anything lies within `far`.
bool intersect_any(vec3 origin_p, vec3 direction, float far, RayOrigin origin) {
    Hit hit;
    return intersect(origin_p, direction, far, origin, true, hit);
}
