// The hull of a beam polygon, grown to all texels it may touch, and what its fragments need to know of it. That comes
// from a texture, since a vertex shader may have no storage blocks, and goes on as flat inputs: a software renderer
// reads those at no cost, and any memory at a high one.
layout(std140, binding = 0) uniform BeamDrawParameters {
    vec2 atlas_size;
    uint texels;  // of a polygon
    uint per_row;  // polygons
};
layout(binding = 0) uniform usampler2D beams;
layout(binding = 1) uniform sampler2D curves;

in vec2 in_position;  // atlas texels
in uint in_polygon;
flat out ivec2 polygon;  // its first texel
flat out vec4 anchor_slope;
flat out vec2 perspective;
flat out vec4 density_nodes;
flat out vec4 band;
flat out vec4 whole_energy[TARGETS];
flat out vec4 edge[2 * EDGES];

const int WHOLE_PARTS = 6;

uvec4 texel(int i) { return texelFetch(beams, polygon + ivec2(i, 0), 0); }

vec4 curve_at(int row, float place) {
    int i = int(place);
    vec4 below = texelFetch(curves, ivec2(i, row), 0);  // exact where both are the same, which mix() is not
    return below + (place - float(i)) * (texelFetch(curves, ivec2(i + 1, row), 0) - below);
}

void main() {
    polygon = ivec2(in_polygon % per_row * texels, in_polygon / per_row);
    uvec4 words[BeamRecord_TEXELS];
    for (int i = 0; i < BeamRecord_TEXELS; ++i) words[i] = texel(i);
    BeamRecord beam = BeamRecord_of(words);
    anchor_slope = vec4(beam.anchor, beam.slope);
    perspective = beam.perspective;
    density_nodes = vec4(beam.density, beam.nodes);
    band = vec4(beam.place, beam.curve_row, beam.edge_count);
    if (EDGES > 0) {
        for (int i = 0; i < 2 * EDGES; ++i) edge[i] = uintBitsToFloat(texel(BeamRecord_TEXELS + i));
    }
    // What a texel gets that is all inside over the whole band.
    for (int g = 0; g < TARGETS; ++g) {
        int row = int(beam.curve_row) + g;
        vec4 sum = vec4(0.0), below = curve_at(row, beam.place.x);
        for (int i = 1; i <= WHOLE_PARTS; ++i) {
            float t = (float(i) - 0.5) / float(WHOLE_PARTS);
            vec4 above = curve_at(row, beam.place.x + beam.place.y * (float(i) / float(WHOLE_PARTS)));
            sum += (beam.density.x + t * (beam.density.y + t * beam.density.z)) * (above - below);
            below = above;
        }
        whole_energy[g] = sum;
    }
    gl_Position = vec4(in_position / atlas_size * 2.0 - 1.0, 0.0, 1.0);
}
