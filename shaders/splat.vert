// One parallelogram a splat by vertex pulling: four corners through an index buffer, nothing instanced.
// Splats of the other class become points outside the picture. SMALL or SWEPT chooses the class.
layout(std140, binding = 0) uniform DrawParameters {
    vec2 atlas_size;
    vec2 table_u;  // texture u = table_u.x * xi + table_u.y
    uint bands;
    uint density_cells;
    uint cumulative_samples;
    uint reserved;
};
layout(std430, binding = 1) readonly buffer Splats { SplatRecord splats[]; };
layout(std430, binding = 5) readonly buffer Bands { vec4 table_bands[]; };
layout(std430, binding = 6) readonly buffer Integrals { vec4 band_integral[]; };  // by layer
layout(std430, binding = 7) readonly buffer Curves { vec4 curve[]; };  // by light and class: density over x, or its running integral

#ifdef SMALL
noperspective out vec2 at;
flat out vec4 box;  // half a texel along x, y in units of sqrt(2) sigma
#else
noperspective out vec4 at;  // across, along xi, table u, table row
flat out vec4 shape;        // half texel across, layer, amplitude, unused
#ifndef POINT_SPECTRUM
flat out vec4 throughput;
flat out vec4 band_xi;
#endif
#endif
#if defined(SMALL) || defined(POINT_SPECTRUM)
flat out vec4 splat_colour[TARGETS];
#endif

#if defined(SMALL) || defined(POINT_SPECTRUM)
// Energy of the splat in each channel of target g, per unit throughput.
vec4 energy(SplatRecord splat, uint g) {
    uint row = splat.layer / (bands * uint(TARGETS)) * uint(TARGETS) + g;
#ifdef POINT_SPECTRUM
    // One wavelength: its density over x, unless the photon stands for a band (or a line).
    vec4 band = table_bands[splat.layer / uint(TARGETS)];
    bool single = splat.xi_range.y <= splat.xi_range.x && band.y > band.x;
    if (single) {
        uint cell = min(uint(splat.throughput.x * float(density_cells)), density_cells - 1u);
        return curve[row * density_cells + cell];
    }
#elif defined(BAND_CUTS)
    if (splat.xi_half > 0.0) {
        vec2 place = clamp(splat.xi_range, 0.0, 1.0) * float(cumulative_samples - 1u);
        uvec2 i = min(uvec2(place), cumulative_samples - 2u);
        vec2 part = place - vec2(i);
        uint base = row * cumulative_samples;
        return mix(curve[base + i.y], curve[base + i.y + 1u], part.y) - mix(curve[base + i.x], curve[base + i.x + 1u], part.x);
    }
#endif
    return band_integral[splat.layer + g];
}
#endif

void main() {
    SplatRecord splat = splats[gl_VertexID >> 2];
    vec2 corner = vec2(float(gl_VertexID & 1), float((gl_VertexID >> 1) & 1)) * 2.0 - 1.0;
#ifdef SMALL
    bool mine = splat.kind == 1u;
    vec2 position = clamp(splat.centre + corner * splat.along, splat.rect.xy, splat.rect.zw);
    at = (position - splat.centre) * splat.across;
    box = vec4(0.5 * splat.across, 0.0, 0.0);
    for (int g = 0; g < TARGETS; ++g) {
        splat_colour[g] = splat.amplitude * energy(splat, uint(g));
    }
#else
    bool mine = splat.kind == 2u;
    float xi = corner.x;
    vec2 position = splat.centre + xi * splat.along + corner.y * splat.across;
    gl_ClipDistance[0] = position.x - splat.rect.x;
    gl_ClipDistance[1] = position.y - splat.rect.y;
    gl_ClipDistance[2] = splat.rect.z - position.x;
    gl_ClipDistance[3] = splat.rect.w - position.y;
    at = vec4(corner.y * splat.y_edge, xi, table_u.x * xi + table_u.y, splat.table_row);
    shape = vec4(splat.y_box, float(splat.layer), splat.amplitude, 0.0);
#ifdef POINT_SPECTRUM
    for (int g = 0; g < TARGETS; ++g) {
        splat_colour[g] = splat.throughput.y * splat.amplitude * energy(splat, uint(g));
    }
#else
    throughput = splat.throughput;
    band_xi = vec4(splat.xi_range, splat.xi_half, splat.inverse_sigma_xi);
#endif
#endif
    gl_Position = mine ? vec4(position / atlas_size * 2.0 - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
