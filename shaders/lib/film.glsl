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
    float thickness;  // where it varies, as a share of where it is thickest; below 0: it is even
    uint waves;  // where it varies, row of what then takes the place of x in its tables
};

Wedge wedge_at(uint texel) {
    uint at = uint(WEDGES_AT) + texel;
    return Wedge_FROM(scene_texel, at);
}

// Of a film that varies: its thickness at a place, as a share of where it is thickest.
float film_share_of_thickest(uint texel, vec3 position) {
    Wedge wedge = wedge_at(texel);
    vec3 way = position - wedge.origin;
    return clamp(wedge.least + dot(wedge.slope, way) + wedge.bend * dot(way, way), 0.0, 1.0);
}

// First row of what this film does. Where none absorbs and light is unpolarised, there is one table: what it reflects
// from either side.
uint film_rows(Film film, uint what) {
    uint rows = uint(FILM_ROW) + film.row - 1u;
    if (FILM_TABLES > 1) rows += what * uint(POLARISED ? 4 * FILM_STEPS : FILM_STEPS);
    return rows;
}

// Mean over the wavelengths from a to b, at a cosine.
float film_mean(Film film, uint rows, float cosine, float a, float b) {
    if (FILM_VARIES && film.thickness >= 0.0) {
        vec2 waves = film.thickness * vec2(spectral_row(film.waves, a), spectral_row(film.waves, b));
        a = min(waves.x, waves.y);
        b = max(waves.x, waves.y);
    }
    float width = max(b - a, 1.0 / float(SPECTRAL_SAMPLES - 1));
    float low = clamp(0.5 * (a + b - width), 0.0, 1.0 - width), high = low + width;
    float below = float(FILM_BELOW),
          at = max(below + cosine * (cosine < 0.0 ? below : float(FILM_STEPS - 1) - below), 0.0);
    uint row = rows + min(uint(at), uint(FILM_STEPS - 2));
    return mix(spectral_row(row, high) - spectral_row(row, low),
               spectral_row(row + 1u, high) - spectral_row(row + 1u, low), at - float(row - rows))
        / width;
}

// Weights at the three places of a band, straight between them: those that come nearest to the means over its quarters,
// and have their sum. `single`: of three wavelengths, each by itself.
vec3 film_over(Film film, uint rows, vec3 x, bool single) {
    vec3 cosine = film.cosine;
    vec2 half_way = 0.5 * (x.xy + x.yz);
    vec4 from = vec4(x.x, half_way.x, x.y, half_way.y), to = vec4(from.yzw, x.z),
         at = mix(cosine.xxyy, cosine.yyzz, vec4(0.25, 0.75, 0.25, 0.75)), mean;
    if ((HERO || GATHERED_SPECTRUM) && single) {
        from = to = x.xyzz;
        at = cosine.xyzz;
    }
    for (int k = 0; k < 4; ++k) mean[k] = film_mean(film, rows, at[k], from[k], to[k]);
    if ((HERO || GATHERED_SPECTRUM) && single) return mean.xyz;
    return mat4x3(1.35, -0.25, 0.15, -0.05, 0.75, -0.45, -0.45, 0.75, -0.05, 0.15, -0.25, 1.35) * mean;
}

// Shares over a band, none below 0 or above 1: nearer to their mean where some were, which clamping would move.
vec3 within_shares(vec3 shares, bool single) {
    if ((HERO || GATHERED_SPECTRUM) && single) return clamp(shares, 0.0, 1.0);
    float mean = clamp(dot(shares, OVER_BAND), 0.0, 1.0);
    vec3 off = shares - mean, room = abs(step(0.0, off) - mean) / max(abs(off), 1e-9);
    return mean + off * min(1.0, min(room.x, min(room.y, room.z)));
}

// Shares of the power of unpolarised light.
vec3 film_share(Film film, uint what, vec3 x, bool single) {
    return within_shares(film_over(film, film_rows(film, what), x, single), single);
}

// The same for s and p.
FresnelPair film_pair(Film film, uint what, vec3 x, bool single) {
    uint rows = film_rows(film, what), step = uint(FILM_STEPS);
    return FresnelPair(within_shares(film_over(film, rows, x, single), single),
        within_shares(film_over(film, rows + step, x, single), single), film_over(film, rows + 2u * step, x, single),
        film_over(film, rows + 3u * step, x, single));
}

// Of all reflected, or let through, between two wavelengths, met at a cosine by light of this Stokes parameter.
float film_between(Film film, bool reflects, float cosine, float q, float a, float b) {
    if (FILM_TABLES == 1) {
        // Beyond total reflection, all.
        float reflected = film_mean(film, film_rows(film, FILM_FRONT), max(cosine, 0.0), a, b);
        return clamp(reflects ? reflected : 1.0 - reflected, 0.0, 1.0);
    }
    uint rows = film_rows(film, reflects ? film.back : FILM_PASSED);
    float share = film_mean(film, rows, cosine, a, b);
    if (POLARISED) {
        float of_p = film_mean(film, rows + uint(FILM_STEPS), cosine, a, b);
        share = 0.5 * (share + of_p + q * (share - of_p));
    }
    return clamp(share, 0.0, 1.0);
}
