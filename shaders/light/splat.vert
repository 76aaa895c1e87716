// Vertex pulling, nothing instanced. SMALL, SWEPT or CUT chooses the class: a swept splat is a parallelogram (four corners through an index buffer), a small one a triangle about
// its square, which costs a software rasteriser one set-up instead of two (it wins below about 40 texels).
layout(std140, binding = 0) uniform DrawParameters {
    vec2 atlas_size;
    vec2 table_u;  // texture u = table_u.x * xi + table_u.y
    uint bands;
    uint density_cells;
    uint cumulative_samples;
    uint reserved;
};
layout(std430, binding = 1) readonly buffer Splats { SplatRecord splats[]; };
layout(std430, binding = 8) readonly buffer Lists { uint lists[]; };  // slots of each kind (splat_list.comp)
layout(std430, binding = 5) readonly buffer Bands { vec4 table_bands[]; };
layout(std430, binding = 6) readonly buffer Integrals { vec4 band_integral[]; };  // by layer
layout(std430, binding = 7) readonly buffer Curves { vec4 curve[]; };  // by light and class: density over x, or its running integral

flat out vec4 rect;
#ifdef CONTACT_LINES
flat out uint side;
#endif
#ifdef SMALL
noperspective out vec2 at;
flat out vec2 half_texel;  // along x, y in units of sqrt(2) sigma
#else
#ifdef FANS
#define INTERPOLATED smooth
#else
#define INTERPOLATED noperspective
#endif
INTERPOLATED out vec3 at;  // across, along xi, table u
flat out vec3 shape;        // half texel across, table row, layer
INTERPOLATED out vec2 wave;  // cycles
flat out vec3 ripple;
#if defined(EDGE) && defined(LIGHT_EDGES)
INTERPOLATED out float lit;
#endif
#ifndef ONE_COLOUR
flat out vec4 throughput;
flat out vec4 band;
#ifdef CUT
flat out float curve_row;
#endif
#endif
#endif
#if defined(SMALL) || defined(ONE_COLOUR)
flat out vec4 splat_colour[TARGETS];
#endif

#if defined(SMALL) || defined(ONE_COLOUR)
// Energy of the splat in each channel of target g, per unit throughput.
vec4 energy(SplatRecord splat, uint g) {
    uint row = splat.layer / (bands * uint(TARGETS)) * uint(TARGETS) + g;
#ifdef POINT_SPECTRUM
    // One wavelength: its density over x, unless the photon stands for a band (or a line).
    vec4 span = table_bands[splat.layer / uint(TARGETS)];
#ifdef HERO
    // Four wavelengths, their cells two a number.
    if (span.y > span.x) {
        uvec2 cells = uvec2(splat.x_range);
        uint base = row * density_cells;
        return splat.throughput.x * curve[base + cells.x / DENSITY_CELLS] + splat.throughput.y * curve[base + cells.x % DENSITY_CELLS]
             + splat.throughput.z * curve[base + cells.y / DENSITY_CELLS] + splat.throughput.w * curve[base + cells.y % DENSITY_CELLS];
    }
    return splat.throughput.x * band_integral[splat.layer + g];
#endif
    bool single = splat.x_range.y <= splat.x_range.x && span.y > span.x;
    if (single) {
        uint cell = min(uint(splat.throughput.x * float(density_cells)), density_cells - 1u);
        return curve[row * density_cells + cell];
    }
#elif defined(BAND_CUTS)
    if (splat.xi_half > 0.0) {
        vec2 place = clamp(splat.x_range, 0.0, 1.0) * float(cumulative_samples - 1u);
        uvec2 i = min(uvec2(place), cumulative_samples - 2u);
        vec2 part = place - vec2(i);
        uint base = row * cumulative_samples;
        return mix(curve[base + i.y], curve[base + i.y + 1u], part.y) - mix(curve[base + i.x], curve[base + i.x + 1u], part.x);
    }
#endif
    return band_integral[splat.layer + g];
}
#endif

#ifdef FANS
#include "lib/fan.glsl"
#endif
#ifdef CLIPPED
// Sine between a splat's sides.
#define THINNEST_SPLAT 1e-6
// The least and largest (xi, eta) in [-1, 1]² that the splat's rectangle holds: what is outside need not be drawn.
vec4 part_inside(SplatRecord splat) {
#ifdef FANS
    vec4 all_of_it = part_that_fans(splat.fan);
#else
    vec4 all_of_it = vec4(-1.0, -1.0, 1.0, 1.0);
#endif
    float area = splat.along.x * splat.across.y - splat.along.y * splat.across.x;
    // At a focus a splat may be too thin to say where in it a place lies.
    if (abs(area) <= THINNEST_SPLAT * length(splat.along) * length(splat.across)) return all_of_it;
    vec4 range = vec4(vec2(1e30), vec2(-1e30));
    for (int i = 0; i < 4; ++i) {
        vec2 to_corner = vec2((i & 1) == 0 ? splat.rect.x : splat.rect.z, (i & 2) == 0 ? splat.rect.y : splat.rect.w) - splat.centre;
        vec2 place = vec2(to_corner.x * splat.across.y - to_corner.y * splat.across.x, splat.along.x * to_corner.y - splat.along.y * to_corner.x) / area;
#ifdef FANS
        // Back through the perspective; where that has no place for it, all is drawn.
        float w = 1.0 - dot(splat.fan, place);
        if (w < 1e-3) return all_of_it;
        place /= w;
#endif
        range = vec4(min(range.xy, place), max(range.zw, place));
    }
    return vec4(max(range.xy, all_of_it.xy), min(range.zw, all_of_it.zw));
}
#endif

void main() {
#ifdef SMALL
    SplatRecord splat = splats[lists[FIRST_OF_KIND + uint(gl_VertexID / 3)]];
#ifdef CONTACT_LINES
    side = splat.layer >> 30u;
    splat.layer &= 0x3fffffffu;
#endif
    int third = gl_VertexID % 3;
    vec2 corner = vec2(third == 1 ? 3.0 : -1.0, third == 2 ? 3.0 : -1.0);
    vec2 reach = corner * splat.along;
    vec2 position = splat.centre + reach;
    at = reach * splat.across;
    half_texel = 0.5 * splat.across;
    for (int g = 0; g < TARGETS; ++g) {
        splat_colour[g] = splat.amplitude * energy(splat, uint(g));
    }
#else
    SplatRecord splat = splats[lists[FIRST_OF_KIND + uint(gl_VertexID >> 2)]];
#ifdef CONTACT_LINES
    side = splat.layer >> 30u;
    splat.layer &= 0x3fffffffu;
#endif
    vec2 corner = vec2(float(gl_VertexID & 1), float((gl_VertexID >> 1) & 1)) * 2.0 - 1.0;
#ifdef CLIPPED
    vec4 inside = part_inside(splat);
    inside.zw = max(inside.xy, inside.zw);
    corner = mix(inside.xy, inside.zw, 0.5 * corner + 0.5);
#endif
    float xi = corner.x;
    vec2 position = splat.centre + xi * splat.along + corner.y * splat.across;
    at = vec3(corner.y * splat.y_edge, xi, table_u.x * xi + table_u.y);
    shape = vec3(splat.y_box, splat.table_row, float(splat.layer));
    wave = xi * splat.waves.xz + corner.y * splat.waves.yw;
    ripple = splat.ripple.xyz;
#if defined(EDGE) && defined(LIGHT_EDGES)
    lit = splat.lit + xi * splat.x_range.x + corner.y * splat.x_range.y;
#endif
#ifdef ONE_COLOUR
    for (int g = 0; g < TARGETS; ++g) {
#ifdef HERO
        splat_colour[g] = splat.amplitude * energy(splat, uint(g));
#else
        splat_colour[g] = splat.throughput.y * splat.amplitude * energy(splat, uint(g));
#endif
    }
#else
    throughput = vec4(splat.throughput.x, splat.amplitude * splat.throughput.yzw);
#ifdef CUT
    band = vec4(splat.x_range, splat.xi_half, splat.inverse_sigma_xi);
    curve_row = float(splat.layer / (bands * uint(TARGETS)) * uint(TARGETS));
#else
    band = vec4(splat.xi_half);
#endif
#endif
#endif
    rect = splat.rect;
#ifdef FANS
    // What is linear in xi and eta stays so: the rasteriser's own perspective.
    float w = 1.0 + dot(splat.fan, corner);
    position = splat.centre * w + (position - splat.centre);
    gl_Position = vec4(position / atlas_size * 2.0 - w, 0.0, w);
#else
    gl_Position = vec4(position / atlas_size * 2.0 - 1.0, 0.0, 1.0);
#endif
}
