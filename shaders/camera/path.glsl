// A camera path: a ray with its pixel columns and, where the scene disperses, one spectral column a group of glasses,
// and what it has lost on its way. It stands for the whole spectrum until it is first bent by glass that disperses;
// from there on for one band of it (`restrict_to_band`).
#ifndef CAMERA_PATH_GLSL
#define CAMERA_PATH_GLSL

#include "lib/finite.glsl"

#define SPATIAL 2
#ifdef LENS
// Columns of the place on the lens come last: of the two sides of a square as large as it is.
#define LENS_COLUMNS (SPATIAL + SPECTRAL_GROUPS)
#define COLUMNS_HELD (LENS_COLUMNS + 2)
#else
#define COLUMNS_HELD (SPATIAL + SPECTRAL_GROUPS)
#endif
// An end of a band that arrives farther off (GPU units) is beyond the facet for good.
#define END_LIMIT 1.0

struct CameraPath {
    vec3 position;
    vec3 direction;
    RayOrigin origin;
    MediumStack medium;
    vec3 dposition[COLUMNS_HELD];   // of the two sides of a pixel, then of each group's variable
    vec3 ddirection[COLUMNS_HELD];
    vec3 band;                      // its lowest wavelength, the one it is traced at, its highest: as x
    vec3 weight;                    // throughput at these
    float inverse_pdf;  // one over the probability of all choices made
    float branch_weight;  // throughput as far as branches are worth following
    uint key;                       // says which branch this is
    int depth;                      // surfaces met
    uint restricted;  // 1: stands for one band
    uint recut;  // 1: its band was cut before the surface ahead, and is not again
    uint planar_so_far;  // 1: its band's ends have kept to its own facets: it met flat ones only
    int cuts;                       // of its band, where paths diverged
#ifdef POLARISED
    Polarisation polarisation;      // of light that would come along the path backwards: by reciprocity it loses as much
#endif
#ifdef ROUGH_SURFACES
    uint ground;                    // 1: a rough surface has turned it, and its pixel's columns are as broad as the lobe, which samples share out
#endif
#ifdef COATS
    float coat_pdf;                 // of its direction, where it comes from a coat: density by steradian; else 0
#endif
#ifdef HAS_GRATING
    uint order;                     // of the grating ahead, the next to be followed; see camera/grating.glsl
#endif
#ifdef SPECTRAL_SWEEP
    // The rays at both ends of the band, by way of the same facets: what columns, being first derivatives, leave out of the sweep.
    vec3 end_position[2];
    vec3 end_direction[2];
    vec2 end_step[SPECTRAL_GROUPS]; // change of each group's variable from the path's own wavelength to the ends
#endif
#ifdef ABSORPTION
    float lengths[ABSORBERS];       // way through each absorbing glass, GPU units; reflections by each coloured mirror
#endif
};

#ifdef SPECTRAL_SWEEP
// Where the columns alone put an end's ray.
void linear_end(CameraPath path, int end, out vec3 position, out vec3 direction)
{
    position = path.position;
    direction = path.direction;
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        position += path.end_step[g][end] * path.dposition[SPATIAL + g];
        direction += path.end_step[g][end] * path.ddirection[SPATIAL + g];
    }
    direction = normalize(direction);
}

// Steps to the ends of the band.
void set_steps(inout CameraPath path)
{
    for (int g = 0; g < SPECTRAL_GROUPS; ++g)
        path.end_step[g] = vec2(variable_step(uint(g), path.band.x, path.band.y), variable_step(uint(g), path.band.z, path.band.y));
}
#endif

// The path's ray at the wavelength x: along the spectral columns, and off them by the share of an end's own deviation that a second
// derivative would have there. So it is exact in the middle, where it also has the columns' slope, and at both ends.
void ray_at(CameraPath path, float x, out vec3 position, out vec3 direction)
{
    position = path.position;
    direction = path.direction;
#ifdef SPECTRAL_SWEEP
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float change = variable_step(uint(g), x, path.band.y);
        position += change * path.dposition[SPATIAL + g];
        direction += change * path.ddirection[SPATIAL + g];
    }
    int end = x < path.band.y ? 0 : 1;
    vec3 end_position, end_direction;
    linear_end(path, end, end_position, end_direction);
    float reach = (x - path.band.y) / max(abs((end == 0 ? path.band.x : path.band.z) - path.band.y), 1e-9);
    float share = reach * reach;
    position += share * ((end == 0 ? path.end_position[0] : path.end_position[1]) - end_position);
    direction = normalize(direction) + share * ((end == 0 ? path.end_direction[0] : path.end_direction[1]) - end_direction);
    direction = normalize(direction);
#endif
}

#ifdef LISTS_SPECULAR
// Counts the looks of a pixel: each sees another point of a light.
uint look_index;
#define DRAW_INDEX look_index
#else
#define DRAW_INDEX p.sample_index
#endif

// Side of the share of its pixel that a sample of this path has, pixels.
float sample_side(CameraPath path)
{
#ifdef LISTS_SPECULAR
    return p.sample_side * inversesqrt(float(p.primary_samples));
#else
    return path.restricted != 0u ? p.band_side : p.sample_side;
#endif
}

#if defined(HAS_DISPERSION) && !defined(RANDOM_WAVELENGTH)
// How much of what looks bright in the whole spectrum lies below either end of a band.
vec2 brightness_of(vec3 band)
{
    return vec2(cell_cdf[int(band.x * float(EMISSION_CELLS) + 0.5)], cell_cdf[int(band.z * float(EMISSION_CELLS) + 0.5)]);
}

// The wavelength below which `share` of a band of this brightness lies.
float quantile(vec2 brightness, float share)
{
    return spectral_row(uint(QUANTILE_ROW), mix(brightness.x, brightness.y, share));
}
#endif

// From here on the path stands for one band only; all others have their turn in other samples.
void restrict_to_band(inout CameraPath path, uint pixel_key)
{
    path.restricted = 1u;
#ifdef RANDOM_WAVELENGTH
    // One of the table's cells, by how bright it looks.
#ifdef EVEN_WAVELENGTHS
    // With the places in the pixel one net: each part of it that holds a few samples has wavelengths from all of the spectrum.
    float u = radical_inverse(p.sample_index, hash_combine(pixel_key, 77u));
#else
    float u = unit_float(hash_combine(hash_combine(pixel_key, 77u), p.sample_index));
#endif
    uint low = 0u, high = uint(EMISSION_CELLS);
    while (high - low > 1u) {
        uint middle = (low + high) / 2u;
        if (cell_cdf[middle] <= u) low = middle;
        else high = middle;
    }
    path.inverse_pdf /= max(cell_cdf[low + 1u] - cell_cdf[low], 1e-9);
    vec3 band = (float(low) + vec3(0.0, 0.5, 1.0)) / float(EMISSION_CELLS);
#else
    // Neighbouring pixels begin with different bands, so that what is still missing shows as grain and not as a tint.
    uint band_number = (turn + (p.dithered != 0u ? hash_combine(pixel_key, 78u) : 0u)) % p.bands;
    took_turn = true;
    vec3 band = (float(band_number) + vec3(0.0, 0.5, 1.0)) / float(p.bands);
    // Traced where half of what looks bright in the band lies on either side: what only this one wavelength decides, such as which facet is
    // met, is then right for most of what is seen.
    band.y = clamp(quantile(brightness_of(band), 0.5), mix(band.x, band.z, 0.1), mix(band.x, band.z, 0.9));
    path.inverse_pdf *= float(p.bands);
#endif
#ifdef POLARISED
    path.polarisation = band_polarisation(path.polarisation, path.band, path.weight, band);
#endif
    path.weight = band_weights(path.band, path.weight, band);
    path.band = band;
#ifdef SPECTRAL_SWEEP
    set_steps(path);
    for (int end = 0; end < 2; ++end) {
        path.end_position[end] = path.position;
        path.end_direction[end] = path.direction;
    }
#endif
}

// The wavelength that a part of a band is traced at: the band's own, where that lies in it, else the part's middle. What the path lets through,
// which bends at its own wavelength, is then the same function in the parts as in the whole, and all branches together stay one.
float anchor_of(CameraPath path, float lo, float hi)
{
    return path.band.y > lo && path.band.y < hi ? path.band.y : 0.5 * (lo + hi);
}

// The same path for a part of its band.
void restrict_to_part(inout CameraPath path, float lo, float hi)
{
    vec3 band = vec3(lo, anchor_of(path, lo, hi), hi);
    CameraPath before = path;
    path.weight = band_weights(before.band, before.weight, band);
    if (band.y != path.band.y) ray_at(before, band.y, path.position, path.direction);
    path.band = band;
#ifdef POLARISED
    path.polarisation = band_polarisation(before.polarisation, before.band, before.weight, band);
    path.polarisation.axis = normalize(path.polarisation.axis - dot(path.polarisation.axis, path.direction) * path.direction);
#endif
#ifdef SPECTRAL_SWEEP
    ray_at(before, lo, path.end_position[0], path.end_direction[0]);
    ray_at(before, hi, path.end_position[1], path.end_direction[1]);
    set_steps(path);
#endif
}

// Column c carried to a surface at `distance` whose geometric normal is `normal_g`.
void transfer_columns(inout CameraPath path, vec3 normal_g, float distance)
{
    for (int c = 0; c < COLUMNS_HELD; ++c)
        path.dposition[c] = transfer_column(path.dposition[c], path.ddirection[c], path.direction, normal_g, distance);
}

#ifdef SPECTRAL_SWEEP
// The ends carried to the plane of a facet that the path has met at its own wavelength; an end that cannot get there, or only far away,
// is where the columns say.
void transfer_ends(inout CameraPath path, vec3 normal_g)
{
    for (int end = 0; end < 2; ++end) {
        vec3 position = path.end_position[end], direction = path.end_direction[end];
        float slope = dot(direction, normal_g), distance = dot(path.position - position, normal_g) / slope;
        vec3 arrived = position + distance * direction, off = arrived - path.position;
        bool holds = slope * dot(path.direction, normal_g) > 0.0 && distance >= 0.0 && dot(off, off) < END_LIMIT * END_LIMIT;
        vec3 position_l, direction_l;
        linear_end(path, end, position_l, direction_l);
        path.end_position[end] = holds ? arrived : position_l;
        path.end_direction[end] = holds ? direction : direction_l;
    }
}
#endif

// Columns that are not finite, or longer than anything, are dropped: the path goes on as a single ray.
bool columns_hold(inout CameraPath path)
{
    bool holds = true;
    for (int c = 0; c < COLUMNS_HELD; ++c) {
        holds = holds && is_within(dot(path.dposition[c], path.dposition[c]), COLUMN_LIMIT * COLUMN_LIMIT);
        holds = holds && is_within(dot(path.ddirection[c], path.ddirection[c]), COLUMN_LIMIT * COLUMN_LIMIT);
    }
    if (holds) return true;
    for (int c = 0; c < COLUMNS_HELD; ++c) path.dposition[c] = path.ddirection[c] = vec3(0.0);
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end) {
        path.end_position[end] = path.position;
        path.end_direction[end] = path.direction;
    }
#endif
    return false;
}

#endif
