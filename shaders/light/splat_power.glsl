// Power of a photon's light as its splat draws it, W: its throughput times the light's power over its band.

float power_sample(uint i) { return table_bands[first_power + i / 4u][i % 4u]; }

float power_until(uint light_and_class, float x) {
    float at = clamp(x, 0.0, 1.0) * float(POWER_SAMPLES - 1);
    uint i = min(uint(at), uint(POWER_SAMPLES - 2));
    uint base = light_and_class * uint(POWER_SAMPLES) + i;
    return mix(power_sample(base), power_sample(base + 1u), at - float(i));
}

const uint POWER_STEPS = 4u;

#if POINT_SPECTRUM
// Power per unit of x in the cell of the density table (`SplatTables`) in which a wavelength falls.
float power_density(uint light_and_class, float x) {
    float cell = min(floor(x * float(DENSITY_CELLS)), float(DENSITY_CELLS - 1u)), cells = float(DENSITY_CELLS);
    return cells * (power_until(light_and_class, (cell + 1.0) / cells) - power_until(light_and_class, cell / cells));
}
#else
// The light's power in each step from the band's low end to the anchor, and from there to its high end.
float step_w[2u * POWER_STEPS];

// Of throughput straight from `from` to `to` over [lo, hi]. Only steps of the running integral are multiplied, so that
// narrow bands keep their digits.
float power_between(uint light_and_class, uint first_step, float lo, float hi, float from, float to) {
    float power = 0.0, before = power_until(light_and_class, lo);
    for (uint k = 0u; k < POWER_STEPS; ++k) {
        float until = power_until(light_and_class, mix(lo, hi, float(k + 1u) / float(POWER_STEPS)));
        step_w[first_step + k] = until - before;
        power += mix(from, to, (float(k) + 0.5) / float(POWER_STEPS)) * (until - before);
        before = until;
    }
    return power;
}
#endif

float photon_power(PhotonRecord photon, uint light_and_class, vec4 band) {
    // A line; or a wavelength that stands for one.
    if (band.y <= band.x) return photon.throughput.y * band.w;
    if (POINT_SPECTRUM) {
        float power = photon.throughput.y * power_density(light_and_class, photon.x_anchor);
        if (HERO) {
            for (int k = 0; k < 3; ++k)
                power += photon.companion_throughput[k] * power_density(light_and_class, photon.companion_x[k]);
        }
        return power;
    } else {
        // One of no width stands for all of its band (`is_cut`).
        if (photon.x_hi <= photon.x_lo) return photon.throughput.y * band.w;
        return power_between(
                   light_and_class, 0u, photon.x_lo, photon.x_anchor, photon.throughput.x, photon.throughput.y)
            + power_between(
                light_and_class, POWER_STEPS, photon.x_anchor, photon.x_hi, photon.throughput.y, photon.throughput.z);
    }
}
