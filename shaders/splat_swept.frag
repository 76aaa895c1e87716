// A Gaussian swept along its spectral chord: across, the average over a texel; along, one look-up of the band's
// spectrum blurred as this fragment sees it. Its cost does not depend on the number of wavelengths.
#include "lib/gaussian.glsl"

noperspective in vec4 at;
flat in vec4 shape;
#ifdef POINT_SPECTRUM
flat in vec4 splat_colour[TARGETS];
#else
flat in vec4 throughput;
flat in vec4 band_xi;
layout(binding = 0) uniform sampler2DArray spectra;
#endif
layout(location = 0) out vec4 deposited[TARGETS];

void main() {
    float share = gaussian_box(at.x, shape.x);
#ifdef POINT_SPECTRUM
    // No sweep: a Gaussian cut at three standard deviations, which holds 0.9973 of it.
    share *= 1.20011 * exp(-4.5 * at.y * at.y);
    for (int g = 0; g < TARGETS; ++g) {
        deposited[g] = share * splat_colour[g];
    }
#else
    float xi = clamp(at.y, band_xi.x, band_xi.y) - throughput.x;
    share *= shape.z * (throughput.y + min(xi, 0.0) * throughput.z + max(xi, 0.0) * throughput.w);
#ifdef BAND_CUTS
    float k = band_xi.w;
    float kept = erf_approx((band_xi.y - at.y) * k) - erf_approx((band_xi.x - at.y) * k);
    float whole = erf_approx((band_xi.z - at.y) * k) - erf_approx((-band_xi.z - at.y) * k);
    share *= clamp(kept / max(whole, 1e-6), 0.0, 1.0);
#endif
    for (int g = 0; g < TARGETS; ++g) {
        deposited[g] = share * texture(spectra, vec3(at.z, at.w, shape.y + float(g)));
    }
#endif
}
