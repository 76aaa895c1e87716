// A path between two surfaces: a ray, its derivatives (the columns: ray differentials), the band of the spectrum that
// it represents, and its throughput over that band. All path tracers share this struct: photons (light/trace.comp),
// camera samples (camera/camera.comp), light gathered from a surface (light/followed.glsl), displayed rays
// (camera/ray_paths.comp). Before including this file a tracer declares `struct Walk`, its own data of a path, and
// PATH_COLUMNS: SPATIAL columns of the footprint, one for each spectral group, then its own.

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
// Distance (GPU units) from the path beyond which an end of the band is taken to have missed the facet.
#define END_LIMIT 1.0

struct Path {
    vec3 position;
    vec3 direction;  // unit, of propagation
    RayOrigin origin;
    MediumStack medium;
    vec3 dposition[COLUMNS_HELD];  // derivative by each side of the footprint, by the spectral variable of each group,
                                   // by the variables of the path tracer
    vec3 ddirection[COLUMNS_HELD];
    vec3 band;  // lowest, traced (the anchor) and highest wavelength, as spectral coordinates x
    vec3 throughput;  // at these three wavelengths
    uint depth;  // surfaces met
    uint restricted;  // 1: represents one band; 0: the whole spectrum, not dispersed yet
    uint recut;  // 1: its band was already cut at the surface ahead, and is not cut there again
    uint order;  // the next order to follow at the grating ahead (camera/grating.glsl), or lobe at the crystal
    uint extraordinary;  // 1: in a crystal, it is the extraordinary wave
    Polarisation polarisation;  // on a camera path: of light sent along it from the camera; by reciprocity
                                // the throughput is the same
    // The rays of the band's lowest and highest wavelength, traced through the same facets: they hold the nonlinear
    // part of the dispersion, which first derivatives miss.
    vec3 end_position[2];
    vec3 end_direction[2];
    vec2 end_step[SPECTRAL_GROUPS];  // change of each group's variable from the anchor to the ends
    Walk walk;
};

// The ray at an end of the band (0: lowest, 1: highest) as extrapolated by the columns.
void linear_end(Path path, int end, out vec3 position, out vec3 direction) {
    position = path.position;
    direction = path.direction;
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float change = end == 0 ? path.end_step[g].x : path.end_step[g].y;  // an index would put it into memory
        position += change * path.dposition[SPATIAL + g];
        direction += change * path.ddirection[SPATIAL + g];
    }
    direction = normalize(direction);
}

// Sets the rays at both ends of the band to the path's own, as for light that is not dispersed yet.
void gather_ends(inout Path path) {
    for (int end = 0; end < 2; ++end) {
        path.end_position[end] = path.position;
        path.end_direction[end] = path.direction;
    }
}

// Change of group g's variable from the anchor to either end of the band.
vec2 steps_to_ends(Path path, int g) {
    return vec2(variable_step(uint(g), path.band.x, path.band.y), variable_step(uint(g), path.band.z, path.band.y));
}

// Sets `end_step` from the band.
void set_steps(inout Path path) {
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) path.end_step[g] = steps_to_ends(path, g);
}

// A path at its start, at the wavelength x and with zero columns; the caller initialises `walk`.
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
    if (HAS_GRATING || HAS_CRYSTAL) path.order = 0u;
    if (HAS_CRYSTAL) path.extraordinary = 0u;
    if (POLARISED) path.polarisation = unpolarised(direction);
    if (SPECTRAL_SWEEP) {
        gather_ends(path);
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) path.end_step[g] = vec2(0.0);
    }
    return path;
}

// The path's ray at the wavelength x: the spectral columns' extrapolation, plus a quadratic correction towards the ray
// at the nearer end of the band, if ends are traced. Exact at the anchor, there with the columns' slope, and at traced
// ends.
void ray_at(Path path, float x, out vec3 position, out vec3 direction) {
    position = path.position;
    direction = path.direction;
    if (SPECTRAL_GROUPS > 0) {
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
            float change = variable_step(uint(g), x, path.band.y);
            position += change * path.dposition[SPATIAL + g];
            direction += change * path.ddirection[SPATIAL + g];
        }
        direction = normalize(direction);
    }
    if (SPECTRAL_SWEEP) {
        int end = x < path.band.y ? 0 : 1;
        vec3 end_position, end_direction;
        linear_end(path, end, end_position, end_direction);
        float reach = (x - path.band.y) / max(abs((end == 0 ? path.band.x : path.band.z) - path.band.y), 1e-9);
        float share = reach * reach;
        position += share * ((end == 0 ? path.end_position[0] : path.end_position[1]) - end_position);
        direction =
            normalize(direction + share * ((end == 0 ? path.end_direction[0] : path.end_direction[1]) - end_direction));
    }
}

// The direction at an end of the band (0: lowest, 1: highest wavelength).
vec3 direction_at_end(Path path, int end) {
    if (SPECTRAL_SWEEP) return path.end_direction[end];
    vec3 direction = path.direction;
    if (SPECTRAL_GROUPS > 0) {
        for (int g = 0; g < SPECTRAL_GROUPS; ++g)
            direction += steps_to_ends(path, g)[end] * path.ddirection[SPATIAL + g];
        direction = normalize(direction);
    }
    return direction;
}

// Restricts a path to `band`, a part of its band, and moves its ray to the new anchor.
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

// Whether the origins of a path's rays at both wavelengths are so near its own that the space between counts as clear.
// `distance`: to the surface ahead.
bool starts_are_near(Path start, float x_low, float x_high, float distance) {
    vec3 low, high, unused;
    ray_at(start, x_low, low, unused);
    ray_at(start, x_high, high, unused);
    return starts_stay_near(low - start.position, high - start.position, distance);
}

// Transfers the columns to a surface at `distance` whose geometric normal is `normal_g` (Igehy 1999).
void transfer_columns(inout Path path, vec3 normal_g, float distance) {
    for (int c = 0; c < PATH_COLUMNS; ++c)
        path.dposition[c] = transfer_column(path.dposition[c], path.ddirection[c], path.direction, normal_g, distance);
}

// Traces the rays at the ends of the band to the plane of the facet that the path has met. An end that misses it, or
// arrives far away, falls back to the extrapolation by the columns.
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

// False if a column is not finite or too long: all are set to zero then, and the path goes on as a single ray.
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

// Makes the surface just hit the origin of the next ray; `inside`: it starts on the inner side of that object.
void leave_surface(inout Path path, Hit hit, bool inside) {
    path.origin = RayOrigin(hit.primitive, hit.object, uint(inside), path.medium.mask);
    path.recut = 0u;
    if (HAS_GRATING || HAS_CRYSTAL) path.order = 0u;
}
