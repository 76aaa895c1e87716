// Boxes of one level of the tree about triangles that have moved; the deeper levels have theirs.
layout(local_size_x = WORKGROUP) in;
layout(rgba32ui, binding = IMAGE_SCENE) uniform restrict uimage2D scene_texels;
layout(std430, binding = 8) readonly restrict buffer Nodes { uint nodes[]; };
uniform uint first;
uniform uint count;
#define LEAF_BIT 0x80000000u

ivec2 texel_at(uint i) { return ivec2(int(i & 4095u), int(i >> 12u)); }

uvec4 scene_texel(uint i) { return imageLoad(scene_texels, texel_at(i)); }

// What the child of this link holds (intersect_tree, lib/intersect.glsl).
void bounds_of(uint link, out vec3 low, out vec3 high) {
    if (link >= LEAF_BIT) {
        uint slot = link & 0x0fffffffu, end = slot + ((link >> 28u) & 7u);
        low = vec3(3.4e38);
        high = vec3(-3.4e38);
        for (; slot < end; ++slot) {
            Triangle facet = Triangle_FROM(scene_texel, uint(TRIANGLES_AT) + slot * uint(Triangle_TEXELS));
            vec3 a = facet.vertex, b = a + facet.edge1, c = a + facet.edge2;
            low = min(low, min(a, min(b, c)));
            high = max(high, max(a, max(b, c)));
        }
    } else {
        uint at = uint(TREE_AT) + 4u * link;
        vec4 a = uintBitsToFloat(scene_texel(at)), b = uintBitsToFloat(scene_texel(at + 1u));
        vec4 c = uintBitsToFloat(scene_texel(at + 2u));
        low = min(a.xyz, vec3(b.zw, c.x));
        high = max(vec3(a.w, b.xy), c.yzw);
    }
}

void main() {
    for (uint i = gl_GlobalInvocationID.x; i < count; i += gl_NumWorkGroups.x * uint(WORKGROUP)) {
        uint at = uint(TREE_AT) + 4u * nodes[first + i];
        uvec4 links = scene_texel(at + 3u);
        vec3 low, high, low_right, high_right;
        bounds_of(links.x, low, high);
        bounds_of(links.y, low_right, high_right);
        imageStore(scene_texels, texel_at(at), floatBitsToUint(vec4(low, high.x)));
        imageStore(scene_texels, texel_at(at + 1u), floatBitsToUint(vec4(high.yz, low_right.xy)));
        imageStore(scene_texels, texel_at(at + 2u), floatBitsToUint(vec4(low_right.z, high_right)));
    }
}
