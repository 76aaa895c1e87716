// Vertex pulling, nothing instanced. SMALL, SWEPT or CUT chooses the class: a swept splat is a parallelogram (four
// corners through an index buffer, where photons are many two triangles without), a small one a triangle about its
// square, which costs a software rasteriser one set-up instead of two (it wins below about 40 texels).
#include "light/splat_setup.glsl"

layout(std430, binding = 8) readonly buffer Lists { uint lists[]; };  // slots of each kind (splat_list.comp)

flat out vec4 rect;
flat out uint side;
#if SMALL
noperspective out vec2 at;
flat out vec2 half_texel;  // along x, y in units of sqrt(2) sigma
#else
#if FANS
#define INTERPOLATED smooth
#else
#define INTERPOLATED noperspective
#endif
INTERPOLATED out vec3 at;
flat out vec3 shape;
INTERPOLATED out vec2 wave;  // cycles
flat out vec3 ripple;
#if EDGE && LIGHT_EDGES
INTERPOLATED out float lit;
#endif
#if !ONE_COLOUR
flat out vec4 throughput;
flat out vec4 band;
#if CUT
flat out float curve_row;
#else
flat out vec4 middles[TARGETS];
flat out vec4 bends[TARGETS];
#endif
#endif
#endif
flat out vec4 splat_colour[TARGETS];

// Sine between a splat's sides.
#define THINNEST_SPLAT 1e-6
// The least and largest (xi, eta) in [-1, 1]² that the splat's rectangle holds: what is outside need not be drawn.
vec4 part_inside(SplatRecord splat) {
    vec4 all_of_it = all_of_splat(splat);
    float area = splat.along.x * splat.across.y - splat.along.y * splat.across.x;
    // At a focus a splat may be too thin to say where in it a place lies.
    if (abs(area) <= THINNEST_SPLAT * length(splat.along) * length(splat.across)) return all_of_it;
    vec4 range = vec4(vec2(1e30), vec2(-1e30));
    for (int i = 0; i < 4; ++i) {
        vec2 to_corner =
            vec2((i & 1) == 0 ? splat.rect.x : splat.rect.z, (i & 2) == 0 ? splat.rect.y : splat.rect.w) - splat.centre;
        vec2 place = vec2(to_corner.x * splat.across.y - to_corner.y * splat.across.x,
                         splat.along.x * to_corner.y - splat.along.y * to_corner.x)
            / area;
        if (FANS) {
            // Back through the perspective; where that has no place for it, all is drawn.
            float w = 1.0 - dot(splat.fan, place);
            if (w < 1e-3) return all_of_it;
            place /= w;
        }
        range = vec4(min(range.xy, place), max(range.zw, place));
    }
    return vec4(max(range.xy, all_of_it.xy), min(range.zw, all_of_it.zw));
}

void main() {
#if SMALL
    SplatRecord splat = splat_at(lists[uint(KIND - 1) * capacity + uint(gl_VertexID / 3)]);
    if (CONTACT_LINES) side = side_taken_off(splat);
    int third = gl_VertexID % 3;
    vec2 corner = vec2(third == 1 ? 3.0 : -1.0, third == 2 ? 3.0 : -1.0);
    vec2 reach = corner * splat.along;
    vec2 position = splat.centre + reach;
    at = reach * splat.across;
    half_texel = half_texel_of(splat);
#else
#if IN_BULK
    // Two triangles, no index buffer: of corners 0, 1, 2 and 2, 1, 3.
    int sixth = gl_VertexID % 6, vertex = gl_VertexID / 6 * 4 + (sixth < 3 ? sixth : sixth == 4 ? 1 : sixth / 2 + 1);
#else
    int vertex = gl_VertexID;
#endif
    SplatRecord splat = splat_at(lists[uint(KIND - 1) * capacity + uint(vertex >> 2)]);
    if (CONTACT_LINES) side = side_taken_off(splat);
    vec2 corner = vec2(float(vertex & 1), float((vertex >> 1) & 1)) * 2.0 - 1.0;
    if (CLIPPED) {
        vec4 inside = part_inside(splat);
        inside.zw = max(inside.xy, inside.zw);
        corner = mix(inside.xy, inside.zw, 0.5 * corner + 0.5);
    }
    vec2 position = splat.centre + corner.x * splat.along + corner.y * splat.across;
    at = place_at(splat, corner);
    shape = shape_of(splat);
    wave = cycles_at(splat, corner);
    ripple = splat.ripple.xyz;
    if (EDGE && LIGHT_EDGES) lit = lit_at(splat, corner);
    if (!ONE_COLOUR) {
        throughput = throughput_of(splat);
        band = band_of(splat);
        if (CUT) {
            curve_row = curve_row_of(splat);
        } else {
            for (int g = 0; g < TARGETS; ++g) {
                middles[g] = channel_middles(splat, uint(g));
                bends[g] = channel_bends(splat, uint(g));
            }
        }
    }
#endif
    if (SMALL || ONE_COLOUR) {
        for (int g = 0; g < TARGETS; ++g) {
            splat_colour[g] = colour_of(splat, uint(g));
        }
    }
    rect = splat.rect;
    if (FANS) {
        // What is linear in xi and eta stays so: the rasteriser's own perspective.
        float w = 1.0 + dot(splat.fan, corner);
        position = splat.centre * w + (position - splat.centre);
        gl_Position = vec4(position / atlas_size * 2.0 - w, 0.0, w);
    } else {
        gl_Position = vec4(position / atlas_size * 2.0 - 1.0, 0.0, 1.0);
    }
}
