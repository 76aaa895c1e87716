// Thin films: what a stack of them reflects and lets through over a band, looked up in tables of running integrals over
// x for each angle (`Stack.table` of app/model/optics/thin_films.py). A mean over any stretch of the spectrum is a
// difference, so that ripples finer than a band weigh as they do in the mean.

// What tables hold.
#define FILM_FRONT 0u  // reflected of light from outside
#define FILM_BACK 1u  // reflected of light from behind
#define FILM_PASSED 2u

struct Film {
    uint row;  // 1 + the first of its rows in the section; 0: there is none
    uint back;  // 1: light comes from behind
    vec3 cosine;  // outside, at the three places of the band; below 0: how far beyond total reflection, to -1
};

// First row of what this film does. Where none absorbs and light is unpolarised, there is one table: what it reflects
// from either side.
uint film_rows(Film film, uint what) {
    uint step = uint(FILM_TABLES) == 1u ? 0u : what * (POLARISED ? 4u : 1u) * uint(FILM_STEPS);
    return uint(FILM_ROW) + film.row - 1u + step;
}

// Mean over the wavelengths from a to b, at a cosine.
float film_mean(uint rows, float cosine, float a, float b) {
    float half_width = max(0.5 * (b - a), 0.5 / float(SPECTRAL_SAMPLES - 1));
    float middle = clamp(0.5 * (a + b), half_width, 1.0 - half_width);
    float above = float(FILM_STEPS - 1 - FILM_BELOW);
    float at =
        clamp(float(FILM_BELOW) + cosine * (cosine < 0.0 ? float(FILM_BELOW) : above), 0.0, float(FILM_STEPS - 1));
    uint cell = min(uint(at), uint(FILM_STEPS - 2));
    vec2 low =
        vec2(spectral_row(rows + cell, middle - half_width), spectral_row(rows + cell + 1u, middle - half_width));
    vec2 high =
        vec2(spectral_row(rows + cell, middle + half_width), spectral_row(rows + cell + 1u, middle + half_width));
    vec2 mean = (high - low) / (2.0 * half_width);
    return mix(mean.x, mean.y, at - float(cell));
}

// Weights at the three places of a band, straight between them: those that come nearest to the means over its quarters,
// and have their sum. `single`: of three wavelengths, each by itself.
vec3 film_over(uint rows, vec3 cosine, vec3 x, bool single) {
    vec4 from = vec4(x, x.z), to = from, at = vec4(cosine, cosine.z);
    if (!single) {
        vec2 half_way = 0.5 * (x.xy + x.yz);
        from = vec4(x.x, half_way.x, x.y, half_way.y);
        to = vec4(half_way.x, x.y, half_way.y, x.z);
        at = mix(cosine.xxyy, cosine.yyzz, vec4(0.25, 0.75, 0.25, 0.75));
    }
    vec4 mean;
    for (int k = 0; k < 4; ++k) mean[k] = film_mean(rows, at[k], from[k], to[k]);
    const mat4x3 nearest = mat4x3(1.35, -0.25, 0.15, -0.05, 0.75, -0.45, -0.45, 0.75, -0.05, 0.15, -0.25, 1.35);
    return single ? mean.xyz : nearest * mean;
}

// Shares over a band, none below 0 or above 1: nearer to their mean where some were, which clamping would move.
vec3 within_shares(vec3 shares, bool single) {
    if (single) return clamp(shares, 0.0, 1.0);
    float mean = clamp(dot(shares, vec3(0.25, 0.5, 0.25)), 0.0, 1.0);
    vec3 off = shares - mean;
    float above = max(max(off.x, off.y), off.z), below = -min(min(off.x, off.y), off.z);
    return mean + off * min(1.0, min((1.0 - mean) / max(above, 1e-9), mean / max(below, 1e-9)));
}

// Shares of the power of unpolarised light.
vec3 film_share(Film film, uint what, vec3 x, bool single) {
    return within_shares(film_over(film_rows(film, what), film.cosine, x, single), single);
}

// The same for s and p.
FresnelPair film_pair(Film film, uint what, vec3 x, bool single) {
    uint rows = film_rows(film, what), step = uint(FILM_STEPS);
    return FresnelPair(within_shares(film_over(rows, film.cosine, x, single), single),
        within_shares(film_over(rows + step, film.cosine, x, single), single),
        film_over(rows + 2u * step, film.cosine, x, single), film_over(rows + 3u * step, film.cosine, x, single));
}

// Of all reflected, or let through, between two wavelengths, met at a cosine by light of this Stokes parameter.
float film_between(Film film, bool reflects, float cosine, float q, float a, float b) {
    if (uint(FILM_TABLES) == 1u) {
        // Beyond total reflection, all.
        float reflected = film_mean(film_rows(film, FILM_FRONT), max(cosine, 0.0), a, b);
        return clamp(reflects ? reflected : 1.0 - reflected, 0.0, 1.0);
    }
    uint rows = film_rows(film, reflects ? film.back : FILM_PASSED);
    float share = film_mean(rows, cosine, a, b);
    if (POLARISED) {
        float of_p = film_mean(rows + uint(FILM_STEPS), cosine, a, b);
        share = 0.5 * (share + of_p + q * (share - of_p));
    }
    return clamp(share, 0.0, 1.0);
}
