// A swept splat whose band was cut at total internal reflection, so that no table was made for it: the difference of
// the light's running integral over x at two places.
#include "lib/gaussian.glsl"

layout(std140, binding = 0) uniform DrawParameters {
    vec2 atlas_size;
    vec2 table_u;
    uint bands;
    uint density_cells;
    uint cumulative_samples;
    uint reserved;
};
layout(std430, binding = 7) readonly buffer Curves { vec4 curve[]; };

#ifdef CONTACT_LINES
#include "lib/contact.glsl"
layout(binding = 1) uniform usampler2D contact_words;
flat in uint side;
#endif
flat in vec4 rect;
noperspective in vec3 at;
flat in vec3 shape;
noperspective in vec2 wave;
flat in vec3 ripple;
flat in vec4 throughput;
flat in vec4 band;  // x_lo, x_hi, half of the sweep in xi, 1 / (sqrt(2) sigma) in xi
flat in float curve_row;
layout(location = 0) out vec4 deposited[TARGETS];

vec4 energy_below(uint row, float x) {
    float place = clamp(x, 0.0, 1.0) * float(cumulative_samples - 1u);
    uint i = min(uint(place), cumulative_samples - 2u);
    uint base = row * cumulative_samples + i;
    return mix(curve[base], curve[base + 1u], place - float(i));
}

// A Gaussian blur of the spectrum is done by the box of the same variance: two lookups in the running integral, and all
// energy is there whatever the band.
void main() {
    bvec4 within = bvec4(greaterThan(gl_FragCoord.xy, rect.xy), lessThan(gl_FragCoord.xy, rect.zw));
    float half_box = sqrt(1.5) / band.w;
    float share = !all(within) ? 0.0 : gaussian_box_fast(at.x, shape.x) * flatness(wave, ripple) / (2.0 * half_box);
#ifdef CONTACT_LINES
    share *= takes_side(texelFetch(contact_words, ivec2(gl_FragCoord.xy), 0).x, side);
#endif
    vec2 ends = clamp(at.y + vec2(-half_box, half_box), -band.z, band.z);
    vec2 x = mix(band.xx, band.yy, 0.5 + 0.5 * ends / band.z);
    float middle = 0.5 * (x.x + x.y) - throughput.x;
    share *= throughput.y + min(middle, 0.0) * throughput.z + max(middle, 0.0) * throughput.w;
    for (int g = 0; g < TARGETS; ++g) {
        uint row = uint(curve_row) + uint(g);
        deposited[g] = share * (energy_below(row, x.y) - energy_below(row, x.x));
    }
}
