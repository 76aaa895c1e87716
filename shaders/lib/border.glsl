// A flat receiver's straight borders, each the plane across the receiver through it: its unit normal points inside.
// Light that a footprint would spread beyond one comes back as an image from there: the method of images for density
// estimates at a border, which keeps an even density even [Silverman 1986, 2.10].
#include "lib/lattice.glsl"

// How far inside of a border a place lies.
float border_distance(vec4 border, vec3 position) { return dot(border.xyz, position) + border.w; }

vec3 mirrored_step(vec4 border, vec3 step) { return step - 2.0 * dot(border.xyz, step) * border.xyz; }

vec3 mirrored_place(vec4 border, vec3 position) {
    return position - 2.0 * border_distance(border, position) * border.xyz;
}

// Standard deviation across a border of a Gaussian with these axes.
float border_spread(vec4 border, vec3 axis_s, vec3 axis_t) {
    return length(vec2(dot(border.xyz, axis_s), dot(border.xyz, axis_t)));
}

// Whether all of a sweep from `from` to `to` lies inside of a border, but for what a band's cut at it leaves or what
// the footprint's blur hides.
bool sweeps_inside(vec4 border, vec3 from, vec3 to, float spread) {
    vec2 ends = vec2(border_distance(border, from), border_distance(border, to));
    return min(ends.x, ends.y) >= -(0.1 * abs(ends.y - ends.x) + 0.25 * spread);
}

// The step of a lattice of `count` points, in spacings, that leads out over a border by the most: one of its three
// shortest ones, either way. `axis_s`, `axis_t`: a spacing along either side.
vec2 step_over_border(vec4 border, vec3 axis_s, vec3 axis_t, float count) {
    float k = shortest_step(count);
    vec2 inwards = vec2(dot(border.xyz, axis_s), dot(border.xyz, axis_t)), shortest = golden_step(k, count),
         before = golden_step(k - 1.0, count);
    vec3 by = vec3(dot(inwards, shortest), dot(inwards, before), dot(inwards, shortest + before));
    vec3 size = abs(by);
    bool is_first = size.x >= max(size.y, size.z), is_second = size.y >= size.z;
    vec2 step = is_first ? shortest : is_second ? before : shortest + before;
    float leads_in = is_first ? by.x : is_second ? by.y : by.z;
    return leads_in > 0.0 ? -step : step;
}

// What a footprint near two borders needs, by the dot product of their normals: the second image too, unless both are
// nearly one line (edges of a polygon that stands for a curve), …
bool needs_both(float cosine) { return cosine < 0.8; }

// … and one across both where they stand at about a right angle: there three images and the footprint fill the round.
// Of other corners two do.
bool needs_corner(float cosine) { return abs(cosine) < 0.3; }
