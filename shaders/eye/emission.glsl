// Spectra as the picture's channels see them. Row r of the table is a spectrum times the observer, summed up from
// x = 0 on; a difference of two of its samples is the light of a stretch of the spectrum in every channel.
#ifndef EYE_EMISSION_GLSL
#define EYE_EMISSION_GLSL

layout(binding = UNIT_EMISSION) uniform sampler2D emission_table;

int emission_cell(float x)
{
    return int(clamp(x, 0.0, 1.0) * float(EMISSION_CELLS) + 0.5);
}

vec4 emission_until(uint row, int target, int cell)
{
    return texelFetch(emission_table, ivec2(cell, int(row) * TARGETS + target), 0);
}

// What a path lets through at the wavelength x.
float transmitted(EyePath path, float x)
{
    float kept = weights_at(path, vec3(x)).x;
#ifdef ABSORPTION
    float depth = 0.0;
    for (int i = 0; i < ABSORBERS; ++i)
        if (path.lengths[i] > 0.0) depth += path.lengths[i] * spectral_row(uint(ABSORPTION_ROW + i), x);
    kept *= exp(-depth);
#endif
#ifdef COLOURED_MIRRORS
    kept *= dot(path.tint, vec3(spectral_row(uint(BASIS_ROW), x), spectral_row(uint(BASIS_ROW + 1), x), spectral_row(uint(BASIS_ROW + 2), x)));
#endif
    return kept;
}

// Stretches that [lo, hi] is cut into, since a path lets through more of one than of another.
int spectral_steps(EyePath path, float lo, float hi)
{
#ifdef SPECTRALLY_TINTED
    return max(1, int(ceil((hi - lo) * float(TINT_STEPS))));
#else
    return path.weight.x == path.weight.z ? 1 : max(1, int(ceil((hi - lo) * 4.0)));
#endif
}

// Adds a light whose spectrum is that of `row`, `factor` times.
void add_spectrum(inout vec4 radiance[TARGETS], EyePath path, uint row, float factor, float lo, float hi)
{
    int steps = spectral_steps(path, lo, hi);
    float step_x = (hi - lo) / float(steps);
    for (int s = 0; s < steps; ++s) {
        float a = lo + float(s) * step_x, b = s + 1 == steps ? hi : a + step_x;
        float amount = factor * path.gain * transmitted(path, 0.5 * (a + b));
        int cell_a = emission_cell(a), cell_b = emission_cell(b);
        for (int t = 0; t < TARGETS; ++t)
            radiance[t] += amount * (emission_until(row, t, cell_b) - emission_until(row, t, cell_a));
    }
}

// The same for a colour: rows `row` to `row` + 2 hold the light times the three functions of the reflectance basis.
void add_colour(inout vec4 radiance[TARGETS], EyePath path, uint row, vec3 colour, float lo, float hi)
{
    int steps = spectral_steps(path, lo, hi);
    float step_x = (hi - lo) / float(steps);
    for (int s = 0; s < steps; ++s) {
        float a = lo + float(s) * step_x, b = s + 1 == steps ? hi : a + step_x;
        vec3 amount = colour * (path.gain * transmitted(path, 0.5 * (a + b)));
        int cell_a = emission_cell(a), cell_b = emission_cell(b);
        for (int t = 0; t < TARGETS; ++t)
            radiance[t] += amount.r * (emission_until(row, t, cell_b) - emission_until(row, t, cell_a))
                         + amount.g * (emission_until(row + 1u, t, cell_b) - emission_until(row + 1u, t, cell_a))
                         + amount.b * (emission_until(row + 2u, t, cell_b) - emission_until(row + 2u, t, cell_a));
    }
}

// Factor on every channel of light whose spectrum is no longer known: that of white light along the same path.
void channel_factors(EyePath path, out vec4 factors[TARGETS])
{
    vec4 white[TARGETS];
    for (int t = 0; t < TARGETS; ++t) factors[t] = vec4(0.0);
    add_colour(factors, path, uint(WHITE_ROW), vec3(1.0), path.band.x, path.band.z);
    for (int t = 0; t < TARGETS; ++t) {
        white[t] = vec4(0.0);
        for (uint c = 0u; c < 3u; ++c) white[t] += emission_until(uint(WHITE_ROW) + c, t, EMISSION_CELLS);
        factors[t] /= max(white[t], vec4(1e-20));
    }
}

#endif
