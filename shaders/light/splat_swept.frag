// A Gaussian swept along its spectral chord (or standing still, where it has one colour): across, the average over a texel; along, one lookup of the band's
// spectrum blurred as this fragment sees it. Its cost does not depend on the number of wavelengths.
#include "lib/gaussian.glsl"

#ifdef CONTACT_LINES
#include "lib/contact.glsl"
layout(binding = 1) uniform usampler2D contact_words;
flat in uint side;
#endif
flat in vec4 rect;
#ifdef FANS
#define INTERPOLATED smooth
#else
#define INTERPOLATED noperspective
#endif
INTERPOLATED in vec3 at;
INTERPOLATED in vec2 wave;
#if defined(EDGE) && defined(LIGHT_EDGES)
INTERPOLATED in float lit;
#endif
flat in vec3 shape;
flat in vec3 ripple;
#ifdef ONE_COLOUR
flat in vec4 splat_colour[TARGETS];
#else
flat in vec4 throughput;
flat in vec4 band;  // half of the band in xi
layout(binding = 0) uniform sampler2DArray spectra;
#endif
layout(location = 0) out vec4 deposited[TARGETS];

void main() {
#ifdef FANS
    // A texel holds so much more of the splat where that is narrower: W times in either direction, and a plane's perspective once more.
    float w = 1.0 / gl_FragCoord.w;
    float share = gaussian_box_fast(at.x, shape.x * w) * w * w * flatness(wave, ripple);
#else
    float share = gaussian_box_fast(at.x, shape.x) * flatness(wave, ripple);
#endif
#ifdef EDGE
    // Clip distances would do, but llvmpipe loses triangles that two of them cut.
    bvec4 within = bvec4(greaterThan(gl_FragCoord.xy, rect.xy), lessThan(gl_FragCoord.xy, rect.zw));
    share = all(within) ? share : 0.0;
#ifdef LIGHT_EDGES
    share *= clamp(lit, 0.0, 1.0);
#endif
#endif
#ifdef CONTACT_LINES
    share *= takes_side(texelFetch(contact_words, ivec2(gl_FragCoord.xy), 0).x, side);
#endif
#ifdef ONE_COLOUR
    // No sweep: a Gaussian cut at three standard deviations, which holds 0.9973 of it.
    share *= 1.20011 * exp(-4.5 * at.y * at.y);
    for (int g = 0; g < TARGETS; ++g) {
        deposited[g] = share * splat_colour[g];
    }
#else
    float xi = clamp(at.y, -band.x, band.x) - throughput.x;
    share *= throughput.y + min(xi, 0.0) * throughput.z + max(xi, 0.0) * throughput.w;
    for (int g = 0; g < TARGETS; ++g) {
        deposited[g] = share * texture(spectra, vec3(at.z, shape.y, shape.z + float(g)));
    }
#endif
}
