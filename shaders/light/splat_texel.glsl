// What a texel gets of a splat: for the fragment shaders and for splat_add.comp alike.
#include "lib/gaussian.glsl"
#include "lib/swept.glsl"

#include "lib/contact.glsl"
layout(binding = 1) uniform usampler2D contact_words;

// Whether the texel about `place` takes light of this side of a line of contact.
float taken_at(vec2 place, uint side) { return takes_side(texelFetch(contact_words, ivec2(place), 0).x, side); }

bool inside_rect(vec2 place, vec4 rect) {
    bvec4 within = bvec4(greaterThan(place, rect.xy), lessThan(place, rect.zw));
    return all(within);
}

#if SMALL
// An axis-aligned Gaussian, integrated exactly over the texel.
float small_share(vec2 at, vec2 half_texel) {
    return gaussian_box(at.x, half_texel.x) * gaussian_box(at.y, half_texel.y);
}
#else
// Across, the average over the texel. A texel holds so much more of a splat that fans out where that is narrower: `w`
// times in either direction, and a plane's perspective once more.
float swept_share(vec3 at, vec3 shape, vec2 wave, vec3 ripple, float w) {
#if FANS
    float share = gaussian_box_fast(at.x, shape.x * w) * w * w * flatness(wave, ripple);
#else
    float share = gaussian_box_fast(at.x, shape.x) * flatness(wave, ripple);
#endif
    return share;
}

// No sweep: a Gaussian cut at three standard deviations, which holds 0.9973 of it.
float share_along(float xi) { return 1.20011 * exp(-4.5 * xi * xi); }
#endif

layout(binding = 0) uniform sampler2DArray spectra;

// Along, one lookup of the band's spectrum blurred as this texel sees it.
vec4 spectrum_at(vec3 at, vec3 shape, int g) {
    return textureLod(spectra, vec3(at.z, shape.y, shape.z + float(g)), 0.0);
}

// Of each channel of a target. The wavelengths that a texel at xi has of a channel lie about xi in a splat that is
// narrow beside its sweep, and in one that is broader wherever the channel has its light: their mean place is so far on
// the way between both as the sweep's variance is part of all.
vec4 throughput_swept(float xi, vec4 throughput, vec4 band, vec4 middles, vec4 bends) {
    return throughput_over(clamp(mix(middles, vec4(xi), band.y), -band.x, band.x), throughput) + bends;
}

#include "light/splat_parameters.glsl"

vec4 energy_below(uint row, float x) {
    float place = clamp(x, 0.0, 1.0) * float(cumulative_samples - 1u);
    uint i = min(uint(place), cumulative_samples - 2u);
    uint base = row * cumulative_samples + i;
    return mix(curve[base], curve[base + 1u], place - float(i));
}

// A Gaussian blur of the spectrum is done by the box of the same variance: two lookups in the running integral, and all
// energy is there whatever the band.
float half_box_of(vec4 band) { return sqrt(1.5) / band.w; }

// The wavelengths in that box about xi.
vec2 window_at(float xi, vec4 band) {
    float half_box = half_box_of(band);
    vec2 ends = clamp(xi + vec2(-half_box, half_box), -band.z, band.z);
    return mix(band.xx, band.yy, 0.5 + 0.5 * ends / band.z);
}

vec4 window_energy(float curve_row, vec2 x, int g) {
    uint row = uint(curve_row) + uint(g);
    return energy_below(row, x.y) - energy_below(row, x.x);
}
