// How a specular surface turns a ray, for every pass that follows rays: the normal it shades with and that normal's
// derivative, the share it reflects over a band, reflected and refracted directions that stay on their side of the
// facet. What kind of surface it is (mirror, glass) the passes decide; a new kind brings its own function that returns
// a `Deflection`.

#include "lib/intersect.glsl"
#include "lib/optics.glsl"

// An interpolated normal is used where it sees the ray from the front by more than rounding.
#define MIN_SHADING_COSINE 1e-6

// The normals of the place a ray has hit, turned against the ray.
struct ShadingFrame {
    vec3 normal;  // unit; decides where the ray goes
    vec3 normal_g;  // unit; the facet's, which judges
    uint interpolated;  // 1: `normal` differs from place to place
    uint refused;  // 1: the interpolated normal sees the ray from behind, and is not used
    vec3 summed;  // interpolated normal before it is made a unit vector …
    vec3 gradient_u;  // … and its change over the facet: along dp by dot(gradient_u, dp) along_u + dot(gradient_v, dp)
                      // along_v
    vec3 gradient_v;
    vec3 along_u;
    vec3 along_v;
};

// One way a surface sends a ray on.
struct Deflection {
    vec3 direction;  // unit
    vec3 normal;  // that turned it: the frame's, or the facet's where that would lead to the wrong side
    float theta;  // dot(incident direction, normal)
    float omega;  // cosine of the transmitted angle (refraction only)
    bool geometric;  // the facet's normal had to judge
    bool exists;  // false: nothing is transmitted
};

// A curved solid's face: its own normal, which turns from place to place.
void curve_as_piece(Hit hit, bool entering, vec3 position, inout ShadingFrame frame) {
    Piece piece = piece_at(hit.primitive & ~CURVED_BIT);
    frame.interpolated = 1u - piece.is_plane;
    if (NORMAL_DERIVATIVES)
        curve_of_piece(piece, position, entering ? 1.0 : -1.0, frame.summed, frame.gradient_u, frame.gradient_v,
            frame.along_u, frame.along_v);
}

// `position`: the place of the hit.
ShadingFrame shading_frame(Hit hit, Triangle facet, vec3 position, vec3 direction) {
    ShadingFrame frame;
    bool entering = dot(direction, hit.normal_g) < 0.0;
    frame.normal = frame.normal_g = entering ? hit.normal_g : -hit.normal_g;
    frame.interpolated = frame.refused = 0u;
    if (NORMAL_DERIVATIVES) {
        frame.summed = frame.normal;
        frame.gradient_u = frame.gradient_v = frame.along_u = frame.along_v = vec3(0.0);
    }
    if (SMOOTH_NORMALS) {
        // Without a branch: some corners' normals where the facet has none. Software renderers execute both sides
        // anyway.
        bool has_normals = (hit.primitive & (PLANE_BIT | CURVED_BIT)) == 0u && facet.normals != NONE;
        uint first = has_normals ? facet.normals : 0u;
        float side = entering ? 1.0 : -1.0;
        vec3 n0 = side * corner_normal(first), n1 = side * corner_normal(first + 1u),
             n2 = side * corner_normal(first + 2u);
        vec3 summed = (1.0 - hit.bary.x - hit.bary.y) * n0 + hit.bary.x * n1 + hit.bary.y * n2;
        vec3 normal = normalize(summed);
        float facing = dot(direction, normal);
        frame.interpolated = uint(has_normals && facing < -MIN_SHADING_COSINE && is_finite(facing));
        frame.refused = uint(has_normals && frame.interpolated == 0u);
        frame.normal = frame.interpolated != 0u ? normal : frame.normal_g;
        if (NORMAL_DERIVATIVES) {
            frame.summed = summed;
            barycentric_gradients(facet.edge1, facet.edge2, frame.gradient_u, frame.gradient_v);
            frame.along_u = n1 - n0;
            frame.along_v = n2 - n0;
        }
    }
    if (CURVED_SOLIDS && is_curved(hit.primitive)) curve_as_piece(hit, entering, position, frame);
    return frame;
}

// Whether the surface keeps its normal round the place that was hit.
bool is_planar(Hit hit, Triangle facet) {
    if (CURVED_SOLIDS && is_curved(hit.primitive)) return piece_at(hit.primitive & ~CURVED_BIT).is_plane != 0u;
    return is_plane(hit.primitive) || facet.normals == NONE;
}

#ifdef NORMAL_DERIVATIVES
// Change of the sum of the corners' normals over the way `along` in the facet's plane.
vec3 summed_change(ShadingFrame frame, vec3 along) {
    return dot(frame.gradient_u, along) * frame.along_u + dot(frame.gradient_v, along) * frame.along_v;
}

// Derivative of the shading normal along the position derivative `dposition`. Also where the facet's normal judges at
// an outline: were it flat there, what it reflects would be a bright speck in the wide glow of its neighbours.
vec3 normal_column(ShadingFrame frame, vec3 dposition) {
    vec3 dnormal = normalised_derivative(frame.summed, summed_change(frame, dposition));
    return (frame.interpolated | frame.refused) != 0u ? dnormal : vec3(0.0);
}

// Shading normal at the place `off` beside the one that was hit.
vec3 normal_beside(ShadingFrame frame, vec3 off) {
    vec3 summed = frame.summed + summed_change(frame, off);
    return frame.interpolated != 0u ? summed * inversesqrt(max(dot(summed, summed), 1e-12)) : frame.normal;
}
#else
#define normal_column(frame, dposition) vec3(0.0)
#define normal_beside(frame, off) frame.normal
#endif

// Reflected by the shading normal, or by the facet's where that would lead into the surface.
Deflection reflect_at(ShadingFrame frame, vec3 direction) {
    float theta = dot(direction, frame.normal);
    vec3 turned = reflect_direction(direction, frame.normal, theta);
    bool geometric = dot(turned, frame.normal_g) <= 0.0;
    vec3 normal = geometric ? frame.normal_g : frame.normal;
    theta = geometric ? dot(direction, frame.normal_g) : theta;
    return Deflection(normalize(reflect_direction(direction, normal, theta)), normal, theta, 0.0, geometric, true);
}

// Refracted by the shading normal, or by the facet's where that would lead back out of the surface. Where the normal
// that judges transmits nothing, nothing is: the surface then reflects all.
Deflection refract_at(ShadingFrame frame, vec3 direction, float eta_it) {
    float theta = dot(direction, frame.normal), cosine2 = transmitted_cosine2(theta, eta_it);
    bool transmits = cosine2 > 0.0;
    vec3 turned = refract_direction(direction, frame.normal, theta, eta_it, sqrt(max(cosine2, 1e-12)));
    bool geometric = transmits && dot(turned, frame.normal_g) >= 0.0;
    vec3 normal = geometric ? frame.normal_g : frame.normal;
    theta = geometric ? dot(direction, frame.normal_g) : theta;
    cosine2 = geometric ? transmitted_cosine2(theta, eta_it) : cosine2;
    float omega = sqrt(max(cosine2, 1e-12));
    turned = refract_direction(direction, normal, theta, eta_it, omega);
    return Deflection(normalize(turned), normal, theta, omega, geometric, cosine2 > 0.0);
}

// Derivatives of the turned direction by one column of the incident ray; `dnormal` is the frame's `normal_column`.
vec3 reflected_column(Deflection turned, vec3 direction, vec3 ddirection, vec3 dnormal) {
    return reflect_column(direction, ddirection, turned.normal, dnormal, turned.theta);
}

vec3 refracted_column(Deflection turned, vec3 direction, vec3 ddirection, vec3 dnormal, float eta_it, float deta_it) {
    return refract_column(direction, ddirection, turned.normal, dnormal, turned.theta, eta_it, turned.omega, deta_it);
}

// Where a ray that starts at `origin` has hit, on the surface as exactly as the surface's own coordinates can say.
vec3 surface_point(Hit hit, Triangle facet, vec3 origin, vec3 direction) {
    vec3 position = origin + hit.distance * direction;
    if ((hit.primitive & (PLANE_BIT | CURVED_BIT)) == 0u)
        position = facet.vertex + hit.bary.x * facet.edge1 + hit.bary.y * facet.edge2;
    if (CONVEX_SOLIDS && is_plane(hit.primitive)) {
        vec4 plane = planes[hit.primitive & ~PLANE_BIT];
        position -= plane.xyz * (dot(position, plane.xyz) - plane.w);
    }
    if (CURVED_SOLIDS && is_curved(hit.primitive)) position = on_piece(piece_at(hit.primitive & ~CURVED_BIT), position);
    return position;
}
