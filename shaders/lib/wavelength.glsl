// Wavelengths drawn by brightness: a row of the spectral tables holds the running integral of a light's density of
// draws over the spectral coordinate x (app/model/optics/spectral_tables.py, `wavelength_cdf`).

#include "lib/scene.glsl"

// The x in band.x..band.y below which the share `place` in [0, 1) of the draws lies, and one over the density of draws
// there. The density is constant between samples, which are the borders of the cells that splats look energies up in:
// their ratio, a photon's weight, then changes from cell to cell only.
float drawn_wavelength(uint row, vec2 band, float place, out float per_density) {
    vec2 ends = vec2(spectral_row(row, band.x), spectral_row(row, band.y));
    float wanted = mix(ends.x, ends.y, place);
    int low = 0, high = SPECTRAL_SAMPLES - 1;
    // Ten halvings of 1024 cells.
    for (int step = 0; step < 10; ++step) {
        int middle = (low + high) / 2;
        bool above = spectral_pair(row, middle).x <= wanted;
        low = above ? middle : low;
        high = above ? high : middle;
    }
    vec2 pair = spectral_pair(row, low);
    float rise = pair.y - pair.x;
    float x = (float(low) + clamp((wanted - pair.x) / max(rise, 1e-9), 0.0, 1.0)) / float(SPECTRAL_SAMPLES - 1);
    // Only rounding ends in a cell without draws.
    per_density = rise > 1e-9 ? (ends.y - ends.x) / (rise * float(SPECTRAL_SAMPLES - 1)) : 0.0;
    return clamp(x, band.x, band.y);
}
