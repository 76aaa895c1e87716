// What a surface of glass or a mirror does to a camera path: its ray, its columns, its weight over its band.
#ifndef EYE_CROSSING_GLSL
#define EYE_CROSSING_GLSL

// Narrower bands are not cut at total internal reflection.
#define MIN_CUT_BAND 1e-4
// GPU units that a cut may move a ray's start.
#define MAX_MOVED_START 0.01

// A surface as a path meets it. The shading normal decides, and the geometric one where that leads to the wrong side.
struct Facing {
    vec3 normal;
    vec3 normal_g;
    bool is_smooth;   // the shading normal is interpolated
#ifdef NORMAL_DERIVATIVES
    vec3 columns[COLUMNS_HELD];
#endif
};

Facing facing_of(Hit hit, EyePath path)
{
    Facing facing;
    facing.normal_g = facing_geometric(hit, path.direction);
    facing.normal = facing_normal(hit, path.direction);
    facing.is_smooth = false;
#ifdef NORMAL_DERIVATIVES
    for (int c = 0; c < COLUMNS_HELD; ++c) facing.columns[c] = vec3(0.0);
    if (all(equal(facing.normal, facing.normal_g)) || (hit.primitive & PLANE_BIT) != 0u) return facing;
    Triangle facet = triangle_at(hit.primitive);
    if (facet.normals == NONE) return facing;
    facing.is_smooth = true;
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
#endif
    return facing;
}

#ifdef NORMAL_DERIVATIVES
#define NORMAL_COLUMN(facing, c) facing.columns[c]
#else
#define NORMAL_COLUMN(facing, c) vec3(0.0)
#endif

// The geometric normal judges a smooth one that leads to the wrong side.
void use_geometric(inout Facing facing)
{
    facing.normal = facing.normal_g;
#ifdef NORMAL_DERIVATIVES
    for (int c = 0; c < COLUMNS_HELD; ++c) facing.columns[c] = vec3(0.0);
#endif
}

void reflect_path(inout EyePath path, Facing facing)
{
    float theta = dot(path.direction, facing.normal);
    if (dot(reflect_direction(path.direction, facing.normal, theta), facing.normal_g) <= 0.0) {
        use_geometric(facing);
        theta = dot(path.direction, facing.normal);
    }
    for (int c = 0; c < COLUMNS_HELD; ++c)
        path.ddirection[c] = reflect_column(path.direction, path.ddirection[c], facing.normal, NORMAL_COLUMN(facing, c), theta);
    path.direction = normalize(reflect_direction(path.direction, facing.normal, theta));
}

#ifdef HAS_DIELECTRIC
// False where the geometric normal, which had to judge, transmits nothing.
bool refract_path(inout EyePath path, Facing facing, Crossing crossing, float n_i, float n_t)
{
    float eta_it = n_i / n_t;
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
    return true;
}

// Cosine to the surface at three places of the band.
vec3 thetas(EyePath path, Facing facing)
{
    vec3 theta = vec3(dot(path.direction, facing.normal));
#if SPECTRAL_GROUPS > 0
    if (path.narrowed) {
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
            float slope = dot(path.ddirection[SPATIAL + g], facing.normal) + dot(path.direction, NORMAL_COLUMN(facing, SPATIAL + g));
            theta.x += slope * variable_step(uint(g), path.band.x, path.band.y);
            theta.z += slope * variable_step(uint(g), path.band.z, path.band.y);
        }
        theta.xz = clamp(theta.xz, -1.0, -1e-6);
    }
#endif
    return theta;
}

#if SPECTRAL_GROUPS > 0
// The wavelength within the path's band where total internal reflection sets in; `passes` says where it transmits.
float cut_of(EyePath path, Facing facing, Crossing crossing, bvec3 passes)
{
    bool low_side = passes.x != passes.y;
    float a = low_side ? path.band.x : path.band.y, b = low_side ? path.band.y : path.band.z;
    bool passes_a = low_side ? passes.x : passes.y;
    for (int i = 0; i < 18; ++i) {
        float x = 0.5 * (a + b), theta_x = dot(path.direction, facing.normal);
        for (int g = 0; g < SPECTRAL_GROUPS; ++g)
            theta_x += (dot(path.ddirection[SPATIAL + g], facing.normal) + dot(path.direction, NORMAL_COLUMN(facing, SPATIAL + g))) * variable_step(uint(g), x, path.band.y);
        float eta_x = medium_index(crossing.before, x) / medium_index(crossing.after, x);
        bool passes_x = transmitted_cosine2(clamp(theta_x, -1.0, -1e-6), eta_x) > 0.0;
        a = passes_x == passes_a ? x : a;
        b = passes_x == passes_a ? b : x;
    }
    return 0.5 * (a + b);
}

// Whether anchoring the parts [x, at] and [at, z] of the band in their middles leaves a path's start where it is known to be clear.
bool cut_is_near(EyePath whole, float at, float distance)
{
    vec3 low, high, unused;
    ray_at(whole, 0.5 * (whole.band.x + at), low, unused);
    ray_at(whole, 0.5 * (at + whole.band.z), high, unused);
    low -= whole.position;
    high -= whole.position;
    float allowed = min(MAX_MOVED_START, 0.1 * distance);
    return max(dot(low, low), dot(high, high)) < allowed * allowed;
}
#endif
#endif

#endif
