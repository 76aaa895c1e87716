// How a footprint widens along itself: columns are a photon's first derivatives, and over a footprint that is long
// beside its distance from where light fans out a straight strip is no picture of that. Pure functions, no bindings.
// Change of a flight's length up to the plane across `normal_g` with a column (before that is transferred,
// lib/optics.glsl).
float change_of_way(vec3 dposition, vec3 ddirection, vec3 direction, vec3 normal_g, float distance) {
    return -dot(dposition + distance * ddirection, normal_g) / dot(direction, normal_g);
}

// The axis, a unit vector in the plane of s and t, along which a footprint of sides with these products (s·s, s·t, t·t)
// is longest.
vec2 longest_axis(vec3 products) {
    float difference = 0.5 * (products.x - products.z), root = sqrt(difference * difference + products.y * products.y);
    vec2 axis = difference >= 0.0 ? vec2(root + difference, products.y) : vec2(products.y, root - difference);
    return dot(axis, axis) > 0.0 ? normalize(axis) : vec2(1.0, 0.0);
}

// Sides `s` and `t` of a footprint, with the directions' change along them, no longer than `widest`: along its longest
// axis, and aside of it.
void keep_within(float widest, inout vec3 s, inout vec3 t, inout vec3 turn_s, inout vec3 turn_t) {
    vec2 axis = longest_axis(vec3(dot(s, s), dot(s, t), dot(t, t)));
    vec3 wide = axis.x * s + axis.y * t, narrow = axis.x * t - axis.y * s;
    float share = min(1.0, widest / max(length(wide), 1e-30)), aside = min(1.0, widest / max(length(narrow), 1e-30));
    // What is well within stays as it is, to the last digit.
    if (share >= 1.0) return;
    vec3 turn_wide = axis.x * turn_s + axis.y * turn_t, turn_narrow = axis.x * turn_t - axis.y * turn_s;
    wide *= share;
    turn_wide *= share;
    narrow *= aside;
    turn_narrow *= aside;
    s = axis.x * wide - axis.y * narrow;
    t = axis.y * wide + axis.x * narrow;
    turn_s = axis.x * turn_wide - axis.y * turn_narrow;
    turn_t = axis.y * turn_wide + axis.x * turn_narrow;
}

// By how much a side of a footprint grows, as a share of itself, for every unit of way that the last flight grows: one
// over its distance from where it is a point.
float growth_of_side(vec3 side, vec3 turn, vec3 direction, vec3 normal_g) {
    vec3 on_plane = turn - dot(turn, normal_g) / dot(direction, normal_g) * direction;
    return dot(on_plane, side) / max(dot(side, side), 1e-30);
}

// A point (s, t) of the lattice, in spacings from the photon's own, lands at (s `side_s` + t `side_t`) / W, where W is
// 1 plus the dot product of (s, t) and what is returned. `way`: changes of the last flight's length; `turn`: of its
// direction. Of light that comes from a point this is all that columns lack. Of other light both axes grow differently,
// and the smaller growth counts: beside a caustic the narrow one grows as one likes.
vec2 fan_of_footprint(vec3 side_s, vec3 side_t, vec3 turn_s, vec3 turn_t, vec2 way, vec3 direction, vec3 normal_g) {
    vec2 axis = longest_axis(vec3(dot(side_s, side_s), dot(side_s, side_t), dot(side_t, side_t)));
    float narrow =
        growth_of_side(axis.x * side_t - axis.y * side_s, axis.x * turn_t - axis.y * turn_s, direction, normal_g);
    float wide =
        growth_of_side(axis.x * side_s + axis.y * side_t, axis.x * turn_s + axis.y * turn_t, direction, normal_g);
    float growth = narrow * wide <= 0.0 ? 0.0 : abs(narrow) < abs(wide) ? narrow : wide;
    return -growth * way;
}

// Least W of what is drawn: beyond it the light flies all but along the plane, and is spread as thinly as W^3.
const float LEAST_W = 0.15;
// Most that W may change aside of the axis along which it changes most.
const float FAN_ASIDE = 0.05;

// What is drawn of a splat whose W changes by `fan` over (xi, eta), which otherwise are in [-1, 1]²: least xi and eta,
// largest xi and eta.
vec4 part_that_fans(vec2 fan) {
    bool along = abs(fan.x) >= abs(fan.y);
    float change = along ? fan.x : fan.y, aside = along ? abs(fan.y) : abs(fan.x);
    float end = min((1.0 - aside - LEAST_W) / max(abs(change), 1e-30), 1.0);
    vec2 range = change > 0.0 ? vec2(-end, 1.0) : vec2(-1.0, end);
    return along ? vec4(range.x, -1.0, range.y, 1.0) : vec4(-1.0, range.x, 1.0, range.y);
}
