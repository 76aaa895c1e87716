// A path between two surfaces: a ray, its derivatives (columns), the band of the spectrum that it stands for, and what
// is left of it there. Every walk carries this struct: photons (light/trace.comp), camera samples (camera/camera.comp),
// light gathered from a surface (light/followed.glsl), rays that are drawn (camera/ray_paths.comp). Before it includes
// this file a walk declares `struct Walk`, what it alone keeps with a path, and PATH_COLUMNS: SPATIAL columns of the
// footprint, one a spectral group, then its own.
#ifndef PATH_GLSL
#define PATH_GLSL

#include "lib/finite.glsl"
#include "lib/medium.glsl"
#include "lib/band.glsl"
#include "lib/interface.glsl"

// An array has at least one element.
#if PATH_COLUMNS > 0
#define COLUMNS_HELD (PATH_COLUMNS)
#else
#define COLUMNS_HELD 1
#endif
// An end of a band that arrives farther off (GPU units) is beyond the facet for good.
#define END_LIMIT 1.0

struct Path {
    vec3 position;
    vec3 direction;  // unit, of propagation
    RayOrigin origin;
    MediumStack medium;
    vec3 dposition[COLUMNS_HELD];  // by the two sides of a footprint, by each spectral group's variable, by the walk's
                                   // own variables
    vec3 ddirection[COLUMNS_HELD];
    vec3 band;  // its lowest wavelength, the one it is traced at (the anchor), its highest: as x
    vec3 throughput;  // at these
    uint depth;  // surfaces met
    uint restricted;  // 1: stands for one band; 0: for the whole spectrum, not dispersed yet
    uint recut;  // 1: its band was cut before the surface ahead, and is not again
#ifdef HAS_GRATING
    uint order;  // of the grating ahead, the next to be followed
#endif
#ifdef POLARISED
    Polarisation polarisation;  // of the camera's paths: of light that would come along backwards; by reciprocity it
                                // loses as much
#endif
#ifdef SPECTRAL_SWEEP
    // The rays at both ends of the band, by way of the same facets: what columns, being first derivatives, leave out of
    // the sweep.
    vec3 end_position[2];
    vec3 end_direction[2];
    vec2 end_step[SPECTRAL_GROUPS];  // change of each group's variable from the anchor to the ends
#endif
    Walk walk;
};

// A path that sets out, at the wavelength x and with columns of no length; its walk is left to the walk.
Path path_at(vec3 position, vec3 direction, RayOrigin origin, MediumStack medium, float x) {
    Path path;
    path.position = position;
    path.direction = direction;
    path.origin = origin;
    path.medium = medium;
    for (int c = 0; c < COLUMNS_HELD; ++c) path.dposition[c] = path.ddirection[c] = vec3(0.0);
    path.band = vec3(x);
    path.throughput = vec3(1.0);
    path.depth = path.restricted = path.recut = 0u;
    if (HAS_GRATING) path.order = 0u;
    if (POLARISED) path.polarisation = unpolarised(direction);
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end) {
            path.end_position[end] = position;
            path.end_direction[end] = direction;
        }
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) path.end_step[g] = vec2(0.0);
    }
    return path;
}

// Where the columns alone put an end's ray.
void linear_end(Path path, int end, out vec3 position, out vec3 direction) {
    position = path.position;
    direction = path.direction;
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        position += path.end_step[g][end] * path.dposition[SPATIAL + g];
        direction += path.end_step[g][end] * path.ddirection[SPATIAL + g];
    }
    direction = normalize(direction);
}

// Both ends on the path's own ray, as where its band begins.
void gather_ends(inout Path path) {
    for (int end = 0; end < 2; ++end) {
        path.end_position[end] = path.position;
        path.end_direction[end] = path.direction;
    }
}

// Steps to the ends of the band.
void set_steps(inout Path path) {
    for (int g = 0; g < SPECTRAL_GROUPS; ++g)
        path.end_step[g] =
            vec2(variable_step(uint(g), path.band.x, path.band.y), variable_step(uint(g), path.band.z, path.band.y));
}

// The path's ray at the wavelength x: along the spectral columns, and off them by the share of an end's own deviation
// that a second derivative would have there. So it is exact at the anchor, where it also has the columns' slope, and at
// ends that are carried.
void ray_at(Path path, float x, out vec3 position, out vec3 direction) {
    position = path.position;
    direction = path.direction;
#if SPECTRAL_GROUPS > 0
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float change = variable_step(uint(g), x, path.band.y);
        position += change * path.dposition[SPATIAL + g];
        direction += change * path.ddirection[SPATIAL + g];
    }
    direction = normalize(direction);
#endif
#ifdef SPECTRAL_SWEEP
    int end = x < path.band.y ? 0 : 1;
    vec3 end_position, end_direction;
    linear_end(path, end, end_position, end_direction);
    float reach = (x - path.band.y) / max(abs((end == 0 ? path.band.x : path.band.z) - path.band.y), 1e-9);
    float share = reach * reach;
    position += share * ((end == 0 ? path.end_position[0] : path.end_position[1]) - end_position);
    direction =
        normalize(direction + share * ((end == 0 ? path.end_direction[0] : path.end_direction[1]) - end_direction));
#endif
}

// The direction at an end of the band.
vec3 direction_at_end(Path path, int end) {
#ifdef SPECTRAL_SWEEP
    return path.end_direction[end];
#else
    vec3 direction = path.direction;
#if SPECTRAL_GROUPS > 0
    for (int g = 0; g < SPECTRAL_GROUPS; ++g)
        direction +=
            variable_step(uint(g), end == 0 ? path.band.x : path.band.z, path.band.y) * path.ddirection[SPATIAL + g];
    direction = normalize(direction);
#endif
    return direction;
#endif
}

// The same path for a part of its band, traced at the part's own anchor.
void restrict_to(inout Path path, vec3 band) {
    Path before = path;
    path.throughput = band_weights(before.band, before.throughput, band);
    if (band.y != before.band.y) ray_at(before, band.y, path.position, path.direction);
    path.band = band;
    if (POLARISED) {
        path.polarisation = band_polarisation(before.polarisation, before.band, before.throughput, band);
        path.polarisation.axis =
            normalize(path.polarisation.axis - dot(path.polarisation.axis, path.direction) * path.direction);
    }
    if (SPECTRAL_SWEEP) {
        ray_at(before, band.x, path.end_position[0], path.end_direction[0]);
        ray_at(before, band.z, path.end_position[1], path.end_direction[1]);
        set_steps(path);
    }
}

// Whether a path's start, moved to where its rays at both wavelengths set out, stays where it is known to be clear.
// `distance`: to the surface ahead.
bool starts_are_near(Path start, float x_low, float x_high, float distance) {
    vec3 low, high, unused;
    ray_at(start, x_low, low, unused);
    ray_at(start, x_high, high, unused);
    return starts_stay_near(low - start.position, high - start.position, distance);
}

// Columns carried to a surface at `distance` whose geometric normal is `normal_g`.
void transfer_columns(inout Path path, vec3 normal_g, float distance) {
    for (int c = 0; c < PATH_COLUMNS; ++c)
        path.dposition[c] = transfer_column(path.dposition[c], path.ddirection[c], path.direction, normal_g, distance);
}

// The ends carried to the plane of a facet that the path has met at its anchor; an end that cannot get there, or only
// far away, is where the columns say.
void transfer_ends(inout Path path, vec3 normal_g) {
    for (int end = 0; end < 2; ++end) {
        vec3 position = path.end_position[end], direction = path.end_direction[end];
        float slope = dot(direction, normal_g), distance = dot(path.position - position, normal_g) / slope;
        vec3 arrived = position + distance * direction, off = arrived - path.position;
        bool holds =
            slope * dot(path.direction, normal_g) > 0.0 && distance >= 0.0 && dot(off, off) < END_LIMIT * END_LIMIT;
        vec3 position_l, direction_l;
        linear_end(path, end, position_l, direction_l);
        path.end_position[end] = holds ? arrived : position_l;
        path.end_direction[end] = holds ? direction : direction_l;
    }
}

// Columns that are not finite, or longer than anything, are dropped: the path goes on as a single ray.
bool columns_hold(inout Path path) {
    bool holds = true;
    for (int c = 0; c < PATH_COLUMNS; ++c) {
        holds = holds && is_within(dot(path.dposition[c], path.dposition[c]), COLUMN_LIMIT * COLUMN_LIMIT);
        holds = holds && is_within(dot(path.ddirection[c], path.ddirection[c]), COLUMN_LIMIT * COLUMN_LIMIT);
    }
    if (holds) return true;
    for (int c = 0; c < PATH_COLUMNS; ++c) path.dposition[c] = path.ddirection[c] = vec3(0.0);
    if (SPECTRAL_SWEEP) gather_ends(path);
    return false;
}

// The path goes on from what it has met, on that object's inner side or not.
void leave_surface(inout Path path, Hit hit, bool inside) {
    path.origin = RayOrigin(hit.primitive, hit.object, uint(inside), path.medium.mask);
    path.recut = 0u;
    if (HAS_GRATING) path.order = 0u;
}

#endif
