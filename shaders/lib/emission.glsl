// From a lattice point to a ray with its two spatial columns. Emission domains are rectangles that
// just hold the specular objects as seen from the light (app/passes/emission_domain.py fits them):
// - point, spot, area: directions on Lambert's azimuthal equal-area plane round an axis, so that
//   solid angle is area and a regular lattice stays regular up to the whole sphere;
// - directional, collimated: positions on a plane across the direction.
#include "lib/lattice.glsl"

// Direction at the point q of Lambert's azimuthal equal-area plane (|q| <= 2), local frame with z
// the axis, and its derivatives along both axes of the plane.
vec3 azimuthal_direction(vec2 q, out vec3 ddirection_dx, out vec3 ddirection_dy) {
    float r2 = dot(q, q);
    float k = sqrt(max(1.0 - 0.25 * r2, 1e-12));
    ddirection_dx = vec3(k - q.x * q.x / (4.0 * k), -q.x * q.y / (4.0 * k), -q.x);
    ddirection_dy = vec3(-q.x * q.y / (4.0 * k), k - q.y * q.y / (4.0 * k), -q.y);
    return vec3(q * k, 1.0 - 0.5 * r2);
}

// Uniform point of the unit disc [Shirley and Chiu 1997, concentric map].
vec2 concentric_disc(vec2 unit) {
    vec2 p = 2.0 * unit - 1.0;
    if (p.x == 0.0 && p.y == 0.0) return vec2(0.0);
    bool wide = abs(p.x) > abs(p.y);
    float r = wide ? p.x : p.y;
    float angle = wide ? 0.78539816 * p.y / p.x : 1.57079633 - 0.78539816 * p.x / p.y;
    return r * vec2(cos(angle), sin(angle));
}
