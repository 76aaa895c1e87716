// From a splat's record to what its texels are worked out from (splat_texel.glsl): for splat.vert, whose rasteriser
// interpolates what is linear in xi and eta, and for splat_add.comp, which works it out at every texel.
#include "light/splat_parameters.glsl"
#include "lib/swept.glsl"

layout(std430, binding = 1) readonly buffer Splats { uvec4 splat_texels[]; };
#define LOAD_SPLAT(at) splat_texels[at]
layout(std430, binding = 5) readonly buffer Bands { vec4 table_bands[]; };
layout(std430, binding = 6) readonly buffer Integrals {
    vec4 band_integral[];
};  // by layer: energy, its mean place in the band (0–1), its standard deviation there

SplatRecord splat_at(uint slot) { return SplatRecord_FROM(LOAD_SPLAT, slot * uint(SplatRecord_TEXELS)); }

// On which side of a line of contact the splat's light landed; its record then holds the layer alone.
uint side_taken_off(inout SplatRecord splat) {
    uint side = splat.layer >> 30u;
    splat.layer &= 0x3fffffffu;
    return side;
}

// Of each channel of target g, where the band lies in [-1, 1].
vec4 middles_of(SplatRecord splat, uint g) { return 2.0 * band_integral[3u * (splat.layer + g) + 1u] - 1.0; }

vec4 spreads_of(SplatRecord splat, uint g) { return 2.0 * band_integral[3u * (splat.layer + g) + 2u]; }

// Energy of the splat in each channel of target g, per unit throughput.
vec4 energy(SplatRecord splat, uint g) {
    uint row = splat.layer / (bands * uint(TARGETS)) * uint(TARGETS) + g;
    if (POINT_SPECTRUM) {
        // One wavelength: its density over x, unless the photon stands for a band (or a line).
        vec4 span = table_bands[splat.layer / uint(TARGETS)];
        if (HERO) {
            // Four wavelengths, their cells two a number.
            if (span.y > span.x) {
                uvec2 cells = uvec2(splat.x_range);
                uint base = row * DENSITY_CELLS;
                return splat.throughput.x * curve[base + cells.x / DENSITY_CELLS]
                    + splat.throughput.y * curve[base + cells.x % DENSITY_CELLS]
                    + splat.throughput.z * curve[base + cells.y / DENSITY_CELLS]
                    + splat.throughput.w * curve[base + cells.y % DENSITY_CELLS];
            }
            return splat.throughput.x * band_integral[3u * (splat.layer + g)];
        }
        bool single = splat.x_range.y <= splat.x_range.x && span.y > span.x;
        if (single) {
            uint cell = min(uint(splat.throughput.x * float(DENSITY_CELLS)), DENSITY_CELLS - 1u);
            return curve[row * DENSITY_CELLS + cell];
        }
    } else if (BAND_CUTS) {
        if (splat.xi_half > 0.0) {
            vec2 place = clamp(splat.x_range, 0.0, 1.0) * float(cumulative_samples - 1u);
            uvec2 i = min(uvec2(place), cumulative_samples - 2u);
            vec2 part = place - vec2(i);
            uint base = row * cumulative_samples;
            return mix(curve[base + i.y], curve[base + i.y + 1u], part.y)
                - mix(curve[base + i.x], curve[base + i.x + 1u], part.x);
        }
    }
    return band_integral[3u * (splat.layer + g)];
}

// What a texel that held all of the splat would have in target g.
vec4 colour_of(SplatRecord splat, uint g) {
    if (POINT_SPECTRUM && (SMALL || HERO)) {
        return splat.amplitude * energy(splat, g);
    } else if (POINT_SPECTRUM) {
        return splat.throughput.y * splat.amplitude * energy(splat, g);
    } else {
        vec4 middles = middles_of(splat, g);
        vec4 throughput =
            throughput_over(middles, splat.throughput) + mean_bend(middles, spreads_of(splat, g), splat.throughput);
        return splat.amplitude * throughput * energy(splat, g);
    }
}

#if SMALL
vec2 half_texel_of(SplatRecord splat) { return 0.5 * splat.across; }
#else
// Across, along xi, table u: at (xi, eta), as the next two.
vec3 place_at(SplatRecord splat, vec2 at) { return vec3(at.y * splat.y_edge, at.x, table_u.x * at.x + table_u.y); }

vec2 cycles_at(SplatRecord splat, vec2 at) { return at.x * splat.waves.xz + at.y * splat.waves.yw; }

float lit_at(SplatRecord splat, vec2 at) { return splat.lit + at.x * splat.x_range.x + at.y * splat.x_range.y; }

// Half texel across, table row, layer of the texture.
vec3 shape_of(SplatRecord splat) {
    uint layers = tables & 0xffffu;
    float row = (splat.table_row + float(splat.layer / layers)) / float(tables >> 16u);
    return vec3(splat.y_box, row, float(splat.layer % layers));
}

vec4 throughput_of(SplatRecord splat) { return vec4(splat.throughput.x, splat.amplitude * splat.throughput.yzw); }

// Cut: x_lo, x_hi, half of the sweep in xi, 1 / (sqrt(2) sigma) in xi; else half of the band in xi, the sweep's part of
// the variance along it.
vec4 band_of(SplatRecord splat) {
#if CUT
    return vec4(splat.x_range, splat.xi_half, splat.inverse_sigma_xi);
#else
    return vec4(splat.xi_half, sweeps_part(splat.xi_half, splat.inverse_sigma_xi), 0.0, 0.0);
#endif
}

// What its texels need of each channel of target g (`throughput_swept`): where its light is, and what the bend adds as
// far as that is blurred.
vec4 channel_middles(SplatRecord splat, uint g) { return splat.xi_half * middles_of(splat, g); }

vec4 channel_bends(SplatRecord splat, uint g) {
    return (1.0 - band_of(splat).y)
        * mean_bend(channel_middles(splat, g), splat.xi_half * spreads_of(splat, g), throughput_of(splat));
}

// First row of the splat's light and class among the curves.
float curve_row_of(SplatRecord splat) { return float(splat.layer / (bands * uint(TARGETS)) * uint(TARGETS)); }
#endif

#include "lib/fan.glsl"
// Least xi and eta, largest xi and eta of what is drawn of a swept splat.
vec4 all_of_splat(SplatRecord splat) { return FANS ? part_that_fans(splat.fan) : vec4(-1.0, -1.0, 1.0, 1.0); }
