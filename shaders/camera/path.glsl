// A camera sample's path: what it carries besides (`Walk`), and how it comes to stand for one band. It stands for the
// whole spectrum until it is first bent by glass that disperses; from there on for one band of it (`restrict_to_band`).

#define SPATIAL 2
// Columns of the place on the lens come last: of the two sides of a square as large as it is.
#define LENS_COLUMNS (SPATIAL + SPECTRAL_GROUPS)
#define PATH_COLUMNS (LENS_COLUMNS + 2 * LENS)
#define HAS_NORMAL_COLUMNS NORMAL_DERIVATIVES
// Microfacets widen the pixel's own columns: a box of sides LOBE_WIDTH times a lobe's standard deviations is as broad
// as it. Samples of a pixel share out the microfacets between them as they do the pixel, and each looks up the light of
// its share of the lobe [Krivanek, Colbert 2008]: lamps and windows seen through ground glass would be specks.
#define WIDENED_BY_LOBES ROUGH_SURFACES
#define LOBE 0
#define LOBE_WIDTH 3.46410161514

struct Walk {
    float inverse_pdf;  // one over the probability of all choices made; 0: the path has ended
    float branch_weight;  // throughput as far as branches are worth following
    uint key;  // says which branch this is
    uint planar_so_far;  // 1: its band's ends have kept to its own facets: it met flat ones only
    uint cuts;  // of its band, where paths diverged
    uint ground;  // 1: a rough surface has turned it, and its pixel's columns are as broad as the lobe, which samples
                  // share out
    float coat_pdf;  // of its direction, where it comes from a coat: density by steradian; else 0
    // What thin films have left of FILM_PARTS parts of the spectrum, two halves a word: an array would lie in memory.
    uvec4 films_a, films_b, films_c;
    float lengths[ABSORBERS];  // way through each absorbing glass, GPU units; reflections by each coloured mirror
};

#include "path/path.glsl"

#define FILM_PARTS 24

void begin_films(inout Walk walk) { walk.films_a = walk.films_b = walk.films_c = uvec4(packHalf2x16(vec2(1.0))); }

float film_part(Walk walk, int part) {
    int word = part >> 1;
    uvec4 words = word < 4 ? walk.films_a : word < 8 ? walk.films_b : walk.films_c;
    uvec2 two = (word & 2) == 0 ? words.xy : words.zw;
    vec2 pair = unpackHalf2x16((word & 1) == 0 ? two.x : two.y);
    return (part & 1) == 0 ? pair.x : pair.y;
}

// Multiplies the next two parts; after twelve times all are in their places again.
void weaken_films(inout Walk walk, vec2 shares) {
    uint word = packHalf2x16(unpackHalf2x16(walk.films_a.x) * shares);
    walk.films_a = uvec4(walk.films_a.yzw, walk.films_b.x);
    walk.films_b = uvec4(walk.films_b.yzw, walk.films_c.x);
    walk.films_c = uvec4(walk.films_c.yzw, word);
}

// What films have left at the wavelength x: the mean over its part, as steep as from neighbour to neighbour.
float left_by_films(Walk walk, float x) {
    float at = spectral_row(uint(PARTS_ROW + 1), x) * float(FILM_PARTS);
    int part = min(int(at), FILM_PARTS - 1);
    float slope = film_part(walk, min(part + 1, FILM_PARTS - 1)) - film_part(walk, max(part - 1, 0));
    return max(film_part(walk, part) + 0.5 * slope * (at - float(part) - 0.5), 0.0);
}

// Counts the looks of a pixel: each sees another point of a light.
uint look_index;
#define DRAW_INDEX (LISTS_SPECULAR ? look_index : p.sample_index)

// Side of the share of its pixel that a sample of this path has, pixels.
float sample_side(Path path) {
    return LISTS_SPECULAR ? p.sample_side * inversesqrt(float(p.primary_samples))
                          : (path.restricted != 0u ? p.band_side : p.sample_side);
}

// How much of what looks bright in the whole spectrum lies below either end of a band.
vec2 brightness_of(vec3 band) {
    return vec2(
        cell_cdf[int(band.x * float(EMISSION_CELLS) + 0.5)], cell_cdf[int(band.z * float(EMISSION_CELLS) + 0.5)]);
}

// The wavelength below which `share` of a band of this brightness lies.
float quantile(vec2 brightness, float share) {
    return spectral_row(uint(QUANTILE_ROW), mix(brightness.x, brightness.y, share));
}

// From here on the path stands for one band only; all others have their turn in other samples.
void restrict_to_band(inout Path path, uint pixel_key) {
    path.restricted = 1u;
    vec3 band;
    if (RANDOM_WAVELENGTH) {
        // One of the table's cells, by how bright it looks. Even ones are one net with the places in the pixel: each
        // part of it that holds a few samples has wavelengths from all of the spectrum.
        float u = EVEN_WAVELENGTHS ? radical_inverse(p.sample_index, hash_combine(pixel_key, 77u))
                                   : unit_float(hash_combine(hash_combine(pixel_key, 77u), p.sample_index));
        uint low = 0u, high = uint(EMISSION_CELLS);
        while (high - low > 1u) {
            uint middle = (low + high) / 2u;
            if (cell_cdf[middle] <= u)
                low = middle;
            else
                high = middle;
        }
        path.walk.inverse_pdf /= max(cell_cdf[low + 1u] - cell_cdf[low], 1e-9);
        band = (float(low) + vec3(0.0, 0.5, 1.0)) / float(EMISSION_CELLS);
    } else {
        // Neighbouring pixels begin with different bands, so that what is still missing shows as grain and not as a
        // tint.
        uint band_number = (turn + (p.dithered != 0u ? hash_combine(pixel_key, 78u) : 0u)) % p.bands;
        took_turn = true;
        band = (float(band_number) + vec3(0.0, 0.5, 1.0)) / float(p.bands);
        // Traced where half of what looks bright in the band lies on either side: what only this one wavelength
        // decides, such as which facet is met, is then right for most of what is seen.
        band.y = clamp(quantile(brightness_of(band), 0.5), mix(band.x, band.z, 0.1), mix(band.x, band.z, 0.9));
        path.walk.inverse_pdf *= float(p.bands);
    }
    if (POLARISED) path.polarisation = band_polarisation(path.polarisation, path.band, path.throughput, band);
    path.throughput = band_weights(path.band, path.throughput, band);
    path.band = band;
    if (SPECTRAL_SWEEP) {
        set_steps(path);
        gather_ends(path);
    }
}

// The wavelength that a part of a band is traced at: the band's own, where that lies in it, else the part's middle.
// What the path lets through, which bends at its own wavelength, is then the same function in the parts as in the
// whole, and all branches together stay one.
float anchor_of(Path path, float lo, float hi) {
    return path.band.y > lo && path.band.y < hi ? path.band.y : 0.5 * (lo + hi);
}
