// The scene on the GPU (app/gpu/scene_buffers.py packs it). Everything is in GPU space.
// What rays look up at scattered places lies in two textures, four words a fetch: a software
// renderer gathers a texel for eight rays at once, while it walks through a storage buffer ray by
// ray (4 times slower for a tree); on a GPU both are the same cache.
#define NONE 0xffffffffu
#define KIND_BLACK 0u
#define KIND_DIFFUSE 1u
#define KIND_MIRROR 2u
#define KIND_DIELECTRIC 3u
#define KIND_GRATING 4u
#define KIND_SHEET 5u
#define KIND_POLARISER 6u
#define IS_GLASS(kind) (kind == KIND_DIELECTRIC || (HAS_SHEET && kind == KIND_SHEET))

// Paths go on from it.
bool is_specular(uint kind) {
    return kind == KIND_MIRROR || IS_GLASS(kind) || kind == KIND_GRATING || (HAS_POLARISER && kind == KIND_POLARISER);
}

// Tree, triangles, corner normals and objects, one after the other, in rows of 4096 texels.
#if SCENE_IMAGE
layout(rgba32ui, binding = IMAGE_SCENE) uniform readonly restrict uimage2D scene_texels;
#else
layout(binding = UNIT_SCENE) uniform usampler2D scene_texels;
#endif
// One spectral table a row; a texel holds two neighbouring samples.
#if SCENE_IMAGE
layout(rg32f, binding = IMAGE_SPECTRA) uniform readonly restrict image2D spectra;
#else
layout(binding = UNIT_SPECTRA) uniform sampler2D spectra;
#endif
// Every ray walks through the same planes: constants to all, where they fit a uniform block.
#if SOLIDS_IN_STORAGE
layout(std430, binding = BIND_SOLIDS) readonly restrict buffer Solids { Solid solids[SOLID_COUNT]; };
layout(std430, binding = BIND_PLANES) readonly restrict buffer Planes { vec4 planes[PLANE_COUNT]; };
#else
layout(std140, binding = BIND_SOLIDS) uniform Solids { Solid solids[SOLID_COUNT]; };
layout(std140, binding = BIND_PLANES) uniform Planes { vec4 planes[PLANE_COUNT]; };
#endif

uvec4 scene_texel(uint i) {
    ivec2 at = ivec2(int(i & 4095u), int(i >> 12u));
    return SCENE_IMAGE ? imageLoad(scene_texels, at) : texelFetch(scene_texels, at, 0);
}

Triangle triangle_at(uint slot) {
    uint at = uint(TRIANGLES_AT) + slot * uint(Triangle_TEXELS);
    return Triangle_FROM(scene_texel, at);
}

Object object_at(uint object) {
    uint at = uint(OBJECTS_AT) + object * uint(Object_TEXELS);
    return Object_FROM(scene_texel, at);
}

// Number of the side of a receiver that something along `direction` meets.
uint side_met(Object thing, vec3 direction, vec3 normal_g) {
    return thing.receiver + uint(dot(direction, normal_g) > 0.0);
}

// Unit normal of a smooth facet's corner; `Triangle.normals` is the first of three.
vec3 corner_normal(uint corner) { return uintBitsToFloat(scene_texel(uint(NORMALS_AT) + corner).xyz); }

// Samples `cell` and cell + 1 of a spectral table's row.
vec2 spectral_pair(uint row, int cell) {
    return SCENE_IMAGE ? imageLoad(spectra, ivec2(cell, int(row))).xy
                       : texelFetch(spectra, ivec2(cell, int(row)), 0).xy;
}

// A spectral table's row at the spectral coordinate x, linear between samples.
float spectral_row(uint row, float x) {
    float at = clamp(x, 0.0, 1.0) * float(SPECTRAL_SAMPLES - 1);
    int cell = min(int(at), SPECTRAL_SAMPLES - 2);
    vec2 ends = spectral_pair(row, cell);
    return mix(ends.x, ends.y, at - float(cell));
}
