// A Gaussian swept along its spectral chord (or standing still, where it has one colour): across, the average over a
// texel; along, one lookup of the band's spectrum blurred as this fragment sees it. Its cost does not depend on the
// number of wavelengths.
#include "light/splat_texel.glsl"

#if CONTACT_LINES
flat in uint side;
#endif
flat in vec4 rect;
#if FANS
#define INTERPOLATED smooth
#else
#define INTERPOLATED noperspective
#endif
INTERPOLATED in vec3 at;
INTERPOLATED in vec2 wave;
INTERPOLATED in float lit;
flat in vec3 shape;
flat in vec3 ripple;
#if ONE_COLOUR
flat in vec4 splat_colour[TARGETS];
#else
flat in vec4 throughput;
flat in vec4 band;  // half of the band in xi, the sweep's part of the variance along it
flat in vec4 middles[TARGETS];
flat in vec4 bends[TARGETS];
#endif
layout(location = 0) out vec4 deposited[TARGETS];

void main() {
#if FANS
    float share = swept_share(at, shape, wave, ripple, 1.0 / gl_FragCoord.w);
#else
    float share = swept_share(at, shape, wave, ripple, 1.0);
#endif
    if (EDGE) {
        // Clip distances would do, but llvmpipe loses triangles that two of them cut.
        share = inside_rect(gl_FragCoord.xy, rect) ? share : 0.0;
        if (LIGHT_EDGES) share *= clamp(lit, 0.0, 1.0);
    }
    if (CONTACT_LINES) share *= taken_at(gl_FragCoord.xy, side);
    if (ONE_COLOUR) {
        share *= share_along(at.y);
        for (int g = 0; g < TARGETS; ++g) {
            deposited[g] = share * splat_colour[g];
        }
    } else {
        for (int g = 0; g < TARGETS; ++g) {
            deposited[g] =
                share * throughput_swept(at.y, throughput, band, middles[g], bends[g]) * spectrum_at(at, shape, g);
        }
    }
}
