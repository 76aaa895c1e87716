// Spectra as the picture's channels see them. Row r of the table is a spectrum times the observer, summed up from
// x = 0 on; a difference of two of its samples is the light of a stretch of the spectrum in every channel.
#ifndef CAMERA_EMISSION_GLSL
#define CAMERA_EMISSION_GLSL

#ifdef SCENE_IMAGE
layout(rgba32f, binding = UNIT_EMISSION) uniform readonly restrict image2D emission_table;
#else
layout(binding = UNIT_EMISSION) uniform sampler2D emission_table;
#endif

int emission_cell(float x)
{
    return int(clamp(x, 0.0, 1.0) * float(EMISSION_CELLS) + 0.5);
}

vec4 emission_until(uint row, int target, int cell)
{
#ifdef SCENE_IMAGE
    return imageLoad(emission_table, ivec2(cell, int(row) * TARGETS + target));
#else
    return texelFetch(emission_table, ivec2(cell, int(row) * TARGETS + target), 0);
#endif
}

// What a path lets through at the wavelength x.
float transmitted(CameraPath path, float x)
{
    float kept = band_weights(path.band, path.weight, vec3(x)).x;
#ifdef ABSORPTION
    float depth = 0.0;
    for (int i = 0; i < ABSORBERS; ++i)
        if (path.lengths[i] > 0.0) depth += path.lengths[i] * spectral_row(uint(ABSORPTION_ROW + i), x);
    kept *= exp(-depth);
#endif
    return kept;
}

// Stretches that the whole spectrum is cut into where Fresnel's reflectance varies over it.
#define WEIGHT_STEPS 16

// A stretch of a path's band, which a look stands for: its ends as cells of the table, and what the path lets through in its middle.
struct Stretch {
    float lo;
    float hi;
    int cell_lo;
    int cell_hi;
    float through;
    int steps;      // parts that differ in what the path lets through
};

Stretch stretch_of(CameraPath path, float lo, float hi)
{
    Stretch stretch;
    stretch.lo = lo;
    stretch.hi = hi;
    stretch.cell_lo = emission_cell(lo);
    stretch.cell_hi = emission_cell(hi);
    stretch.through = path.gain * transmitted(path, 0.5 * (lo + hi));
#ifdef ABSORPTION
    stretch.steps = max(1, int(ceil((hi - lo) * float(TINT_STEPS))));
#else
    stretch.steps = path.weight.x == path.weight.z ? 1 : max(1, int(ceil((hi - lo) * float(WEIGHT_STEPS))));
#endif
    return stretch;
}

// Adds a light whose spectrum is that of `row`, `factor` times.
void add_spectrum(CameraPath path, Stretch stretch, uint row, float factor)
{
    WHEN(stretch.steps == 1)
        for (int t = 0; t < TARGETS; ++t)
            radiance[t] += factor * stretch.through * (emission_until(row, t, stretch.cell_hi) - emission_until(row, t, stretch.cell_lo));
    COUNT_ROUNDS(stretch.steps);
    float step_x = (stretch.hi - stretch.lo) / float(stretch.steps);
    for (int s = 0; s < stretch.steps && stretch.steps > 1; ++s) {
        float a = stretch.lo + float(s) * step_x, b = s + 1 == stretch.steps ? stretch.hi : a + step_x;
        float amount = factor * path.gain * transmitted(path, 0.5 * (a + b));
        int cell_a = emission_cell(a), cell_b = emission_cell(b);
        for (int t = 0; t < TARGETS; ++t)
            radiance[t] += amount * (emission_until(row, t, cell_b) - emission_until(row, t, cell_a));
    }
}

// The same under a colour: `row` holds the light itself, the three after it the light times the functions of the reflectance basis.
void add_colour(CameraPath path, Stretch stretch, uint row, vec3 colour)
{
    bool grey = colour.r == colour.g && colour.g == colour.b;
    WHEN(grey) add_spectrum(path, stretch, row, colour.r);
    for (uint c = grey ? 3u : 0u; c < 3u; ++c) add_spectrum(path, stretch, row + 1u + c, c == 0u ? colour.r : (c == 1u ? colour.g : colour.b));
}

// Factor on every channel of light whose spectrum is no longer known: that of white light along the same path.
void channel_factors(CameraPath path, Stretch stretch, out vec4 factors[TARGETS])
{
    bool whole = stretch.steps == 1 && !path.narrowed;
    for (int t = 0; t < TARGETS; ++t) factors[t] = vec4(stretch.through);
    WHEN(!whole) {
        COUNT_ROUNDS(stretch.steps * TARGETS);
        float step_x = (stretch.hi - stretch.lo) / float(stretch.steps);
        for (int t = 0; t < TARGETS; ++t) {
            vec4 kept = vec4(0.0);
            for (int s = 0; s < stretch.steps; ++s) {
                float a = stretch.lo + float(s) * step_x, b = s + 1 == stretch.steps ? stretch.hi : a + step_x;
                kept += path.gain * transmitted(path, 0.5 * (a + b)) * (emission_until(uint(WHITE_ROW), t, emission_cell(b)) - emission_until(uint(WHITE_ROW), t, emission_cell(a)));
            }
            factors[t] = kept / max(emission_until(uint(WHITE_ROW), t, EMISSION_CELLS), vec4(1e-20));
        }
    }
}

#endif
