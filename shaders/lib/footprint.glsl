// Footprints of several sides as one of two: what a lookup of the camera is averaged over (the sides of a sample's share of its pixel, of the lens,
// and the way from one lookup along the sweep to the next), what a photon is drawn over behind a rough surface.
#ifndef FOOTPRINT_GLSL
#define FOOTPRINT_GLSL

// The two axes of a box of about this covariance, times 12.
void box_of_covariance(float xx, float yy, float xy, out vec2 major, out vec2 minor)
{
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
void box_of_three(vec2 a, vec2 b, vec2 c, out vec2 major, out vec2 minor)
{
    box_of_covariance(a.x * a.x + b.x * b.x + c.x * c.x, a.y * a.y + b.y * b.y + c.y * c.y, a.x * a.y + b.x * b.y + c.x * c.y, major, minor);
}

// A footprint of sides `a` and `b` in the plane across `normal`, joined with another one's, `c` and `d`.
void join_sides(vec3 normal, inout vec3 a, inout vec3 b, vec3 c, vec3 d)
{
    vec3 s = normalize(cross(normal, abs(normal.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0))), t = cross(normal, s);
    vec4 along = vec4(dot(a, s), dot(b, s), dot(c, s), dot(d, s)), beside = vec4(dot(a, t), dot(b, t), dot(c, t), dot(d, t));
    vec2 major, minor;
    box_of_covariance(dot(along, along), dot(beside, beside), dot(along, beside), major, minor);
    a = major.x * s + major.y * t;
    b = minor.x * s + minor.y * t;
}

#endif
