// What a surface of glass or a mirror does to a camera path: its ray, its columns, the rays at the ends of its band.
#ifndef CAMERA_INTERFACE_GLSL
#define CAMERA_INTERFACE_GLSL

// The normals that a path meets, worked out once: whatever turns it asks for them again.
struct PathFrame {
    ShadingFrame shading;
#ifdef SPECTRAL_SWEEP
    vec3 end_normal[2];           // where the rays at the ends of its band arrive
#endif
#ifdef NORMAL_DERIVATIVES
    vec3 columns[COLUMNS_HELD];   // derivatives of the shading normal
#endif
};

PathFrame path_frame(CameraPath path, Hit hit, Triangle facet)
{
    PathFrame frame;
    frame.shading = shading_frame(hit, facet, path.position, path.direction);
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end)
        frame.end_normal[end] = normal_beside(frame.shading, path.restricted != 0u ? path.end_position[end] - path.position : vec3(0.0));
#endif
#ifdef NORMAL_DERIVATIVES
    for (int c = 0; c < COLUMNS_HELD; ++c) frame.columns[c] = normal_column(frame.shading, path.dposition[c]);
#endif
    return frame;
}

#ifdef NORMAL_DERIVATIVES
#define NORMAL_COLUMN(frame, c) frame.columns[c]
#else
#define NORMAL_COLUMN(frame, c) vec3(0.0)
#endif

void reflect_path(inout CameraPath path, PathFrame frame)
{
    Deflection turned = reflect_at(frame.shading, path.direction);
    for (int c = 0; c < COLUMNS_HELD; ++c)
        path.ddirection[c] = reflected_column(turned, path.direction, path.ddirection[c], NORMAL_COLUMN(frame, c));
    path.direction = turned.direction;
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end) {
        vec3 normal = turned.geometric ? turned.normal : frame.end_normal[end], direction = path.end_direction[end];
        path.end_direction[end] = normalize(reflect_direction(direction, normal, dot(direction, normal)));
    }
#endif
}

#ifdef HAS_DIELECTRIC
// `turned`: how the path's own ray is refracted.
void refract_path(inout CameraPath path, Deflection turned, PathFrame frame, MediumInterface boundary, vec3 n_i, vec3 n_t)
{
    float eta_it = n_i.y / n_t.y;
    for (int c = 0; c < COLUMNS_HELD; ++c) {
        float deta_it = 0.0;
#if SPECTRAL_GROUPS > 0
        if (c >= SPATIAL && c < SPATIAL + SPECTRAL_GROUPS) deta_it = index_ratio_derivative(boundary, uint(c - SPATIAL), path.band.y, n_i.y, n_t.y);
#endif
        path.ddirection[c] = refracted_column(turned, path.direction, path.ddirection[c], NORMAL_COLUMN(frame, c), eta_it, deta_it);
    }
    path.direction = turned.direction;
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end) {
        vec3 normal = turned.geometric ? turned.normal : frame.end_normal[end], direction = path.end_direction[end];
        float eta_end = (end == 0 ? n_i.x : n_i.z) / (end == 0 ? n_t.x : n_t.z), theta = dot(direction, normal);
        float cosine2 = transmitted_cosine2(theta, eta_end);
        vec3 position_l, direction_l;
        linear_end(path, end, position_l, direction_l);
        path.end_direction[end] = cosine2 > 0.0 && theta < 0.0 ? normalize(refract_direction(direction, normal, theta, eta_end, sqrt(cosine2))) : direction_l;
    }
#endif
}

// Cosine of incidence at three places of the band.
vec3 incidence_over_band(CameraPath path, PathFrame frame)
{
    vec3 theta = vec3(dot(path.direction, frame.shading.normal));
#ifdef SPECTRAL_SWEEP
    if (path.restricted != 0u) {
        theta.x = dot(path.end_direction[0], frame.end_normal[0]);
        theta.z = dot(path.end_direction[1], frame.end_normal[1]);
        theta.xz = clamp(theta.xz, -1.0, -1e-6);
    }
#endif
    return theta;
}

#ifdef SPECTRAL_SWEEP
// The wavelength within the path's band where total internal reflection sets in; `passes` says where it transmits. The cosine is straight
// between the three that are known exactly: bands are narrow, and a cut goes to the next border of the emission table's cells.
float onset_of(CameraPath path, vec3 theta, MediumInterface boundary, bvec3 passes)
{
    float dtheta[SPECTRAL_GROUPS];
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) dtheta[g] = 0.0;
    return total_reflection_onset(path.band, theta.y, dtheta, theta.xz - theta.y, boundary, passes);
}
#endif
#endif

#ifdef POLARISED
// What polarised light meets at a surface.
struct PolarisedEvent {
    vec3 s[3];              // of the planes of incidence at the three places of the band
    Polarisation seen;      // the path's state, counted from these
    FresnelPair reflection;
};

PolarisedEvent polarised_event(CameraPath path, PathFrame frame, FresnelPair reflection)
{
    PolarisedEvent event;
    event.s[1] = incidence_axis(path.direction, frame.shading.normal, path.polarisation.axis);
    event.s[0] = event.s[2] = event.s[1];
#ifdef SPECTRAL_SWEEP
    if (path.restricted != 0u) {
        event.s[0] = incidence_axis(path.end_direction[0], frame.end_normal[0], event.s[1]);
        event.s[2] = incidence_axis(path.end_direction[1], frame.end_normal[1], event.s[1]);
    }
#endif
    event.seen = in_plane(path.polarisation, path.direction, event.s);
    event.reflection = reflection;
    return event;
}

// The state of a path that has been turned.
void polarise_path(inout CameraPath path, PolarisedEvent event, bool reflects)
{
    FresnelPair pair = event.reflection;
    if (!reflects) pair = fresnel_transmission(pair);
    path.polarisation = out_of_plane(behind_interface(event.seen, pair), path.direction, event.s);
}
#endif

#ifdef SPECTRAL_SWEEP
// Whether anchoring the parts [x, at] and [at, z] of the band leaves a path's start where it is known to be clear.
bool cut_is_near(CameraPath whole, float at, float distance)
{
    vec3 low, high, unused;
    ray_at(whole, anchor_of(whole, whole.band.x, at), low, unused);
    ray_at(whole, anchor_of(whole, at, whole.band.z), high, unused);
    return starts_stay_near(low - whole.position, high - whole.position, distance);
}
#endif

#endif
