// What a surface of glass or a mirror does to a camera path: its ray, its columns, its weight over its band.
#ifndef CAMERA_CROSSING_GLSL
#define CAMERA_CROSSING_GLSL

// GPU units that a cut may move a ray's start.
#define MAX_MOVED_START 0.01

// A surface as a path meets it. The shading normal decides, and the geometric one where that leads to the wrong side.
struct ShadingFrame {
    vec3 normal;
    vec3 normal_g;
#ifdef SPECTRAL_SWEEP
    vec3 end_normal[2];
#endif
#ifdef NORMAL_DERIVATIVES
    vec3 columns[COLUMNS_HELD];
#endif
};

// Whether the surface there has a normal of its own at every place.
bool is_curved(Hit hit)
{
#ifdef NORMAL_DERIVATIVES
    return (hit.primitive & PLANE_BIT) == 0u && triangle_at(hit.primitive).normals != NONE;
#else
    return false;
#endif
}

ShadingFrame shading_frame_of(Hit hit, CameraPath path)
{
    ShadingFrame facing;
    facing.normal_g = facing_geometric(hit, path.direction);
    facing.normal = facing_normal(hit, path.direction);
#ifdef SPECTRAL_SWEEP
    facing.end_normal[0] = facing.end_normal[1] = facing.normal;
#endif
#ifdef NORMAL_DERIVATIVES
    for (int c = 0; c < COLUMNS_HELD; ++c) facing.columns[c] = vec3(0.0);
    if (all(equal(facing.normal, facing.normal_g)) || (hit.primitive & PLANE_BIT) != 0u) return facing;
    Triangle facet = triangle_at(hit.primitive);
    if (facet.normals == NONE) return facing;
    vec3 gradient_u, gradient_v;
    barycentric_gradients(facet.edge1, facet.edge2, gradient_u, gradient_v);
    vec3 n0 = corner_normal(facet.normals), n1 = corner_normal(facet.normals + 1u), n2 = corner_normal(facet.normals + 2u);
    vec3 summed = (1.0 - hit.bary.x - hit.bary.y) * n0 + hit.bary.x * n1 + hit.bary.y * n2;
    float side = dot(summed, facing.normal) < 0.0 ? -1.0 : 1.0;
    for (int c = 0; c < COLUMNS_HELD; ++c) {
        vec3 dp = path.dposition[c];
        vec3 dsummed = dot(gradient_u, dp) * (n1 - n0) + dot(gradient_v, dp) * (n2 - n0);
        facing.columns[c] = side * normalised_derivative(summed, dsummed);
    }
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end) {
        vec3 off = path.narrowed ? path.end_position[end] - path.position : vec3(0.0);
        vec3 normal = summed + dot(gradient_u, off) * (n1 - n0) + dot(gradient_v, off) * (n2 - n0);
        facing.end_normal[end] = side * normal * inversesqrt(max(dot(normal, normal), 1e-12));
    }
#endif
#endif
    return facing;
}

#ifdef NORMAL_DERIVATIVES
#define NORMAL_COLUMN(facing, c) facing.columns[c]
#else
#define NORMAL_COLUMN(facing, c) vec3(0.0)
#endif

// The geometric normal judges a smooth one that leads to the wrong side.
void use_geometric(inout ShadingFrame facing)
{
    facing.normal = facing.normal_g;
#ifdef SPECTRAL_SWEEP
    facing.end_normal[0] = facing.end_normal[1] = facing.normal_g;
#endif
#ifdef NORMAL_DERIVATIVES
    for (int c = 0; c < COLUMNS_HELD; ++c) facing.columns[c] = vec3(0.0);
#endif
}

void reflect_path(inout CameraPath path, ShadingFrame facing)
{
    float theta = dot(path.direction, facing.normal);
    if (dot(reflect_direction(path.direction, facing.normal, theta), facing.normal_g) <= 0.0) {
        use_geometric(facing);
        theta = dot(path.direction, facing.normal);
    }
    for (int c = 0; c < COLUMNS_HELD; ++c)
        path.ddirection[c] = reflect_column(path.direction, path.ddirection[c], facing.normal, NORMAL_COLUMN(facing, c), theta);
    path.direction = normalize(reflect_direction(path.direction, facing.normal, theta));
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end)
        path.end_direction[end] = normalize(reflect_direction(path.end_direction[end], facing.end_normal[end], dot(path.end_direction[end], facing.end_normal[end])));
#endif
}

#ifdef HAS_DIELECTRIC
// False where the geometric normal, which had to judge, transmits nothing.
bool refract_path(inout CameraPath path, ShadingFrame facing, MediumInterface crossing, vec3 n_i3, vec3 n_t3)
{
    float n_i = n_i3.y, n_t = n_t3.y, eta_it = n_i / n_t;
    float theta = dot(path.direction, facing.normal);
    float omega = sqrt(max(transmitted_cosine2(theta, eta_it), 1e-12));
    if (dot(refract_direction(path.direction, facing.normal, theta, eta_it, omega), facing.normal_g) >= 0.0) {
        use_geometric(facing);
        theta = dot(path.direction, facing.normal);
        float cosine2 = transmitted_cosine2(theta, eta_it);
        if (cosine2 <= 0.0) return false;
        omega = sqrt(cosine2);
    }
    for (int c = 0; c < COLUMNS_HELD; ++c) {
        float deta_it = 0.0;
#if SPECTRAL_GROUPS > 0
        if (c >= SPATIAL) deta_it = index_ratio_derivative(crossing, uint(c - SPATIAL), path.band.y, n_i, n_t);
#endif
        path.ddirection[c] = refract_column(path.direction, path.ddirection[c], facing.normal, NORMAL_COLUMN(facing, c), theta, eta_it, omega, deta_it);
    }
    path.direction = normalize(refract_direction(path.direction, facing.normal, theta, eta_it, omega));
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end) {
        float eta_end = (end == 0 ? n_i3.x : n_i3.z) / (end == 0 ? n_t3.x : n_t3.z);
        float theta_end = dot(path.end_direction[end], facing.end_normal[end]);
        float cosine2 = transmitted_cosine2(theta_end, eta_end);
        vec3 position_l, direction_l;
        linear_end(path, end, position_l, direction_l);
        path.end_direction[end] = cosine2 > 0.0 && theta_end < 0.0 ? normalize(refract_direction(path.end_direction[end], facing.end_normal[end], theta_end, eta_end, sqrt(cosine2))) : direction_l;
    }
#endif
    return true;
}

// Cosine to the surface at three places of the band.
vec3 thetas(CameraPath path, ShadingFrame facing)
{
    vec3 theta = vec3(dot(path.direction, facing.normal));
#ifdef SPECTRAL_SWEEP
    if (path.narrowed) {
        theta.x = dot(path.end_direction[0], facing.end_normal[0]);
        theta.z = dot(path.end_direction[1], facing.end_normal[1]);
        theta.xz = clamp(theta.xz, -1.0, -1e-6);
    }
#endif
    return theta;
}

#if SPECTRAL_GROUPS > 0
// The wavelength within the path's band where total internal reflection sets in; `passes` says where it transmits.
float cut_of(CameraPath path, vec3 theta, MediumInterface crossing, bvec3 passes)
{
    bool low_side = passes.x != passes.y;
    float a = low_side ? path.band.x : path.band.y, b = low_side ? path.band.y : path.band.z;
    float from = a, theta_a = low_side ? theta.x : theta.y, slope = ((low_side ? theta.y : theta.z) - theta_a) / max(b - a, 1e-9);
    bool passes_a = low_side ? passes.x : passes.y;
    for (int i = 0; i < 18; ++i) {
        float x = 0.5 * (a + b);
        float eta_x = medium_index(crossing.before, x) / medium_index(crossing.after, x);
        bool passes_x = transmitted_cosine2(clamp(theta_a + slope * (x - from), -1.0, -1e-6), eta_x) > 0.0;
        a = passes_x == passes_a ? x : a;
        b = passes_x == passes_a ? b : x;
    }
    return 0.5 * (a + b);
}

// Whether anchoring the parts [x, at] and [at, z] of the band leaves a path's start where it is known to be clear.
bool cut_is_near(CameraPath whole, float at, float distance)
{
    vec3 low, high, unused;
    ray_at(whole, anchor_of(whole, whole.band.x, at), low, unused);
    ray_at(whole, anchor_of(whole, at, whole.band.z), high, unused);
    low -= whole.position;
    high -= whole.position;
    float allowed = min(MAX_MOVED_START, 0.1 * distance);
    return max(dot(low, low), dot(high, high)) < allowed * allowed;
}
#endif
#endif

#endif
