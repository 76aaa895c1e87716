// Footprints of several sides as one of two: what a lookup of the camera is averaged over (the sides of a sample's
// share of its pixel, of the lens, and the way from one lookup along the sweep to the next), what a photon is drawn
// over behind a rough surface.
#include "lib/optics.glsl"

// The two axes of a box of about this covariance, times 12.
void box_of_covariance(float xx, float yy, float xy, out vec2 major, out vec2 minor) {
    float mean = 0.5 * (xx + yy), difference = 0.5 * (xx - yy);
    float root = sqrt(difference * difference + xy * xy);
    float large = mean + root, small = max(mean - root, 0.0);
    vec2 axis = difference >= 0.0 ? vec2(difference + root, xy) : vec2(xy, root - difference);
    float size = length(axis);
    axis = size > 1e-30 ? axis / size : vec2(1.0, 0.0);
    major = sqrt(large) * axis;
    minor = sqrt(small) * vec2(-axis.y, axis.x);
}

// … as the sum of three.
void box_of_three(vec2 a, vec2 b, vec2 c, out vec2 major, out vec2 minor) {
    box_of_covariance(a.x * a.x + b.x * b.x + c.x * c.x, a.y * a.y + b.y * b.y + c.y * c.y,
        a.x * a.y + b.x * b.y + c.x * c.y, major, minor);
}

// A footprint of sides `a` and `b` in the plane across `normal`, joined with another one's, `c` and `d`.
void join_sides(vec3 normal, inout vec3 a, inout vec3 b, vec3 c, vec3 d) {
    vec3 s, t;
    frame_across(normal, s, t);
    vec4 along = vec4(dot(a, s), dot(b, s), dot(c, s), dot(d, s)),
         beside = vec4(dot(a, t), dot(b, t), dot(c, t), dot(d, t));
    vec2 major, minor;
    box_of_covariance(dot(along, along), dot(beside, beside), dot(along, beside), major, minor);
    a = major.x * s + major.y * t;
    b = minor.x * s + minor.y * t;
}

#include "lib/fan.glsl"

// Of a footprint's longest side, squared: flatter ones have no inverse.
#define FLATTEST_COVERED 1e-4

// Makes a footprint of sides `a` and `b` as broad as one of sides `c` and `d` wherever it is narrower: in coordinates
// in which it is a circle, axes of the other that are shorter than its radius stay its own. `fan` (lib/fan.glsl) goes
// on along the new sides. Whether it grew.
bool cover_sides(vec3 normal, inout vec3 a, inout vec3 b, inout vec2 fan, vec3 c, vec3 d) {
    if (dot(c, c) + dot(d, d) <= 0.0) return false;
    vec3 s, t;
    frame_across(normal, s, t);
    mat2 own = mat2(dot(a, s), dot(a, t), dot(b, s), dot(b, t)),
         other = mat2(dot(c, s), dot(c, t), dot(d, s), dot(d, t));
    float area = own[0].x * own[1].y - own[1].x * own[0].y;
    if (abs(area) <= FLATTEST_COVERED * (dot(a, a) + dot(b, b))) {
        fan = vec2(0.0);
        join_sides(normal, a, b, c, d);
        return true;
    }
    mat2 rows = transpose(mat2(own[1].y, -own[0].y, -own[1].x, own[0].x) * other / area);
    vec2 first = longest_axis(vec3(dot(rows[0], rows[0]), dot(rows[0], rows[1]), dot(rows[1], rows[1]))),
         second = vec2(-first.y, first.x);
    vec2 grown = max(vec2(length(rows * first), length(rows * second)), 1.0);
    if (grown == vec2(1.0)) return false;
    first *= grown.x;
    second *= grown.y;
    fan = vec2(dot(fan, first), dot(fan, second));
    vec3 before = a;
    a = first.x * before + first.y * b;
    b = second.x * before + second.y * b;
    return true;
}
