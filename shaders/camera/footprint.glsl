// What a lookup is averaged over: the sides of a sample's share of its pixel, and the way from one lookup along the sweep to the next.
#ifndef CAMERA_FOOTPRINT_GLSL
#define CAMERA_FOOTPRINT_GLSL

// The two axes of a box of about the same covariance as the sum of three.
void box_of_three(vec2 a, vec2 b, vec2 c, out vec2 major, out vec2 minor)
{
    float xx = a.x * a.x + b.x * b.x + c.x * c.x;
    float yy = a.y * a.y + b.y * b.y + c.y * c.y;
    float xy = a.x * a.y + b.x * b.y + c.x * c.y;
    float mean = 0.5 * (xx + yy), difference = 0.5 * (xx - yy);
    float root = sqrt(difference * difference + xy * xy);
    float large = mean + root, small = max(mean - root, 0.0);
    vec2 axis = difference >= 0.0 ? vec2(difference + root, xy) : vec2(xy, root - difference);
    float size = length(axis);
    axis = size > 1e-30 ? axis / size : vec2(1.0, 0.0);
    major = sqrt(large) * axis;
    minor = sqrt(small) * vec2(-axis.y, axis.x);
}

#endif
