// Faces of curved solids: a quadric's inside or a half-space each, where f(p) = |rows q|² - 2 linear · q - constant <=
// 0 with q = p - origin (app/model/curved_solids.py). All are convex: a ray is inside from one root to the other.
#include "lib/scene.glsl"
#include "lib/optics.glsl"

// Beyond everything, and what keeps a plane's missing root there.
#define BEYOND_ALL 1e30
#define LEAST_SQUARE 1e-30
#define LEAST_SLOPE 1e-20

Piece piece_at(uint number) {
    uint at = uint(PIECES_AT) + number * uint(Piece_TEXELS);
    return Piece_FROM(scene_texel, at);
}

vec3 stretched(Piece piece, vec3 way) {
    return vec3(dot(piece.row_x, way), dot(piece.row_y, way), dot(piece.row_z, way));
}

// Half of the gradient's change over `way`.
vec3 piece_curvature(Piece piece, vec3 way) {
    vec3 along = stretched(piece, way);
    return along.x * piece.row_x + along.y * piece.row_y + along.z * piece.row_z;
}

// Half of f's gradient: outward.
vec3 piece_gradient(Piece piece, vec3 position) {
    return piece_curvature(piece, position - piece.origin) - piece.linear;
}

// The place on the face nearest to `position`, which is on it but for rounding.
vec3 on_piece(Piece piece, vec3 position) {
    vec3 q = position - piece.origin, along = stretched(piece, q), gradient = piece_gradient(piece, position);
    float f = dot(along, along) - 2.0 * dot(piece.linear, q) - piece.constant;
    return position - (0.5 * f / dot(gradient, gradient)) * gradient;
}

// Where a ray comes in and goes out, in ascending order where it meets the face at all; else the first is the greater.
// The ray is looked at from its place nearest to the face's own, so that a far start costs no digits.
vec2 piece_interval(Piece piece, vec3 position, vec3 direction) {
    float ahead = dot(piece.origin - position, direction);
    vec3 q = position + ahead * direction - piece.origin, along = stretched(piece, q),
         turned = stretched(piece, direction);
    float a = max(dot(turned, turned), LEAST_SQUARE);
    float b = dot(turned, along) - dot(piece.linear, direction);
    float c = dot(along, along) - 2.0 * dot(piece.linear, q) - piece.constant;
    float discriminant = b * b - a * c;
    // Of the two ways to write each root the one without a difference of what may be alike.
    float sum = b + (b < 0.0 ? -1.0 : 1.0) * sqrt(max(discriminant, 0.0));
    sum = abs(sum) < LEAST_SLOPE ? LEAST_SLOPE : sum;
    float one = -sum / a, other = -c / sum;
    return discriminant < 0.0 ? vec2(BEYOND_ALL, -BEYOND_ALL) : ahead + vec2(min(one, other), max(one, other));
}

// … of a ray that starts on the face: where it leaves it again, if it goes on within.
float piece_chord(Piece piece, vec3 position, vec3 direction) {
    vec3 turned = stretched(piece, direction);
    float a = max(dot(turned, turned), LEAST_SQUARE);
    return -2.0 * dot(piece_gradient(piece, position), direction) / a;
}

// Way along the face's outward normal to where a ray meets it after `distance`.
float height_over(Piece piece, vec3 position, vec3 direction, float distance) {
    return distance * dot(direction, normalize(piece_gradient(piece, position + distance * direction)));
}

// Normal, turned to `side`, and its change over a way in the plane across it as `ShadingFrame` has them
// (lib/interface.glsl): along two directions across.
void curve_of_piece(Piece piece, vec3 position, float side, out vec3 summed, out vec3 across_s, out vec3 across_t,
    out vec3 along_s, out vec3 along_t) {
    summed = side * piece_gradient(piece, position);
    frame_across(normalize(summed), across_s, across_t);
    along_s = side * piece_curvature(piece, across_s);
    along_t = side * piece_curvature(piece, across_t);
}
