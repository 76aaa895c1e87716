// The one falloff of a spot's edge, shared by photons and by shadow rays.

// Angle between unit vectors, rad. From the sine too: the cosine alone loses small angles in float32.
float angle_between(vec3 a, vec3 b) { return atan(length(cross(a, b)), dot(a, b)); }

// 1 inside the inner cone, 0 outside the outer one, a smoothstep of the angle between; a hard edge
// where both are equal. `cone`: x = inner half angle, y = outer half angle, radians; a point light
// has both at 4 (beyond pi).
float spot_falloff(vec3 direction, vec3 axis, vec2 cone) {
    float angle = angle_between(direction, axis);
    float t = clamp((cone.y - angle) / max(cone.y - cone.x, 1e-9), 0.0, 1.0);
    float soft = t * t * (3.0 - 2.0 * t);
    return cone.y - cone.x > 1e-7 ? soft : (angle <= cone.y ? 1.0 : 0.0);
}
