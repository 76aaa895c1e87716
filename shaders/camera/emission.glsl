// Spectra as the picture's channels see them. Row r of the table is a spectrum times the observer, summed up from
// x = 0 on; a difference of two of its samples is the light of a wavelength interval in every channel.

#ifdef SCENE_IMAGE
layout(rgba32f, binding = UNIT_EMISSION) uniform readonly restrict image2D emission_table;
#else
layout(binding = UNIT_EMISSION) uniform sampler2D emission_table;
#endif

int emission_cell(float x) { return int(clamp(x, 0.0, 1.0) * float(EMISSION_CELLS) + 0.5); }

vec4 emission_until(uint row, int target, int cell) {
    return SCENE_IMAGE ? imageLoad(emission_table, ivec2(cell, int(row) * TARGETS + target))
                       : texelFetch(emission_table, ivec2(cell, int(row) * TARGETS + target), 0);
}

// What a path lets through at the wavelength x.
float transmitted(Path path, float x) {
    float kept = band_weight(path.band, path.throughput, x);
    if (HAS_FILM) kept *= left_by_films(path.walk, x);
    if (ABSORPTION) {
        float depth = 0.0;
        for (int i = 0; i < ABSORBERS; ++i)
            if (path.walk.lengths[i] > 0.0) depth += path.walk.lengths[i] * spectral_row(uint(ABSORPTION_ROW + i), x);
        kept *= exp(-depth);
    }
    return kept;
}

// Stretches that the whole spectrum is cut into where Fresnel's reflectance varies over it.
#define WEIGHT_STEPS 16

// A wavelength interval of a path, which a lookup stands for: its ends as cells of the table, and what the path lets
// through in its middle.
struct WavelengthInterval {
    float lo;
    float hi;
    int cell_lo;
    int cell_hi;
    float through;
    int steps;  // parts that differ in what the path lets through
};

WavelengthInterval wavelength_interval(Path path, float lo, float hi) {
    WavelengthInterval interval;
    interval.lo = lo;
    interval.hi = hi;
    interval.cell_lo = emission_cell(lo);
    interval.cell_hi = emission_cell(hi);
    interval.through = path.walk.inverse_pdf * transmitted(path, 0.5 * (lo + hi));
    bool bends = ABSORPTION || HAS_FILM, even = !bends && path.throughput.x == path.throughput.z;
    interval.steps = even ? 1 : max(1, int(ceil((hi - lo) * float(bends ? TINT_STEPS : WEIGHT_STEPS))));
    return interval;
}

// Adds a light whose spectrum is that of `row`, `factor` times.
void add_spectrum(Path path, WavelengthInterval interval, uint row, float factor) {
    if (interval.steps == 1)
        for (int t = 0; t < TARGETS; ++t)
            radiance[t] += factor * interval.through
                * (emission_until(row, t, interval.cell_hi) - emission_until(row, t, interval.cell_lo));
    COUNT_ROUNDS(interval.steps);
    float step_x = (interval.hi - interval.lo) / float(interval.steps);
    for (int s = 0; s < interval.steps && interval.steps > 1; ++s) {
        float a = interval.lo + float(s) * step_x, b = s + 1 == interval.steps ? interval.hi : a + step_x;
        float amount = factor * path.walk.inverse_pdf * transmitted(path, 0.5 * (a + b));
        int cell_a = emission_cell(a), cell_b = emission_cell(b);
        for (int t = 0; t < TARGETS; ++t)
            radiance[t] += amount * (emission_until(row, t, cell_b) - emission_until(row, t, cell_a));
    }
}

// The same under a colour: `row` holds the light itself, the three after it the light times the functions of the
// reflectance basis.
void add_colour(Path path, WavelengthInterval interval, uint row, vec3 colour) {
    bool grey = colour.r == colour.g && colour.g == colour.b;
    if (grey) add_spectrum(path, interval, row, colour.r);
    for (uint c = grey ? 3u : 0u; c < 3u; ++c)
        add_spectrum(path, interval, row + 1u + c, c == 0u ? colour.r : (c == 1u ? colour.g : colour.b));
}

// Factor on every channel of light whose spectrum is no longer known: that of white light along the same path.
void channel_factors(Path path, WavelengthInterval interval, out vec4 factors[TARGETS]) {
    bool whole = interval.steps == 1 && path.restricted == 0u;
    for (int t = 0; t < TARGETS; ++t) factors[t] = vec4(interval.through);
    if (!whole) {
        COUNT_ROUNDS(interval.steps * TARGETS);
        float step_x = (interval.hi - interval.lo) / float(interval.steps);
        for (int t = 0; t < TARGETS; ++t) {
            vec4 kept = vec4(0.0);
            for (int s = 0; s < interval.steps; ++s) {
                float a = interval.lo + float(s) * step_x, b = s + 1 == interval.steps ? interval.hi : a + step_x;
                kept += path.walk.inverse_pdf * transmitted(path, 0.5 * (a + b))
                    * (emission_until(uint(WHITE_ROW), t, emission_cell(b))
                        - emission_until(uint(WHITE_ROW), t, emission_cell(a)));
            }
            factors[t] = kept / max(emission_until(uint(WHITE_ROW), t, EMISSION_CELLS), vec4(1e-20));
        }
    }
}
