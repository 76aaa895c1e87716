// Triangles and corner normals where their objects stand now, from where they were packed.
#include "lib/moved.glsl"
layout(local_size_x = WORKGROUP) in;
layout(rgba32ui, binding = 0) uniform readonly restrict uimage2D packed_texels;
layout(rgba32ui, binding = IMAGE_SCENE) uniform writeonly restrict uimage2D scene_texels;
uniform uint count;
#define NONE 0xffffffffu

ivec2 texel_at(uint i) { return ivec2(int(i & 4095u), int(i >> 12u)); }

uvec4 packed_texel(uint i) { return imageLoad(packed_texels, texel_at(i)); }

void main() {
    for (uint slot = gl_GlobalInvocationID.x; slot < count; slot += gl_NumWorkGroups.x * uint(WORKGROUP)) {
        uint at = uint(TRIANGLES_AT) + slot * uint(Triangle_TEXELS);
        Triangle facet = Triangle_FROM(packed_texel, at);
        vec4 x = place_row(facet.object, 0), y = place_row(facet.object, 1), z = place_row(facet.object, 2);
        mat3 linear = transpose(mat3(x.xyz, y.xyz, z.xyz));
        facet.vertex = linear * facet.vertex + vec3(x.w, y.w, z.w);
        facet.edge1 = linear * facet.edge1;
        facet.edge2 = linear * facet.edge2;
        uvec4 texels[Triangle_TEXELS];
        to_texels(facet, texels);
        for (uint k = 0u; k < uint(Triangle_TEXELS); ++k) imageStore(scene_texels, texel_at(at + k), texels[k]);
        if (facet.normals == NONE) continue;
        // The inverse transpose, but for a factor that no normal keeps.
        mat3 turn = mat3(cross(linear[1], linear[2]), cross(linear[2], linear[0]), cross(linear[0], linear[1]));
        for (uint k = 0u; k < 3u; ++k) {
            uint corner = uint(NORMALS_AT) + facet.normals + k;
            vec3 normal = normalize(turn * uintBitsToFloat(packed_texel(corner).xyz));
            imageStore(scene_texels, texel_at(corner), uvec4(floatBitsToUint(normal), 0u));
        }
    }
}
