// The scene's storage buffers (app/gpu/scene_buffers.py packs them). Everything is in GPU space.
#ifndef SCENE_GLSL
#define SCENE_GLSL

#define NONE 0xffffffffu
#define KIND_BLACK 0u
#define KIND_DIFFUSE 1u
#define KIND_MIRROR 2u
#define KIND_DIELECTRIC 3u

layout(std430, binding = BIND_TRIANGLES) readonly restrict buffer Triangles { Triangle triangles[]; };
#ifdef HAS_TREE
layout(std430, binding = BIND_NODES) readonly restrict buffer Nodes { Node nodes[]; };
#endif
#ifdef SMOOTH_NORMALS
layout(std430, binding = BIND_NORMALS) readonly restrict buffer Normals { vec4 corner_normals[]; };
#endif
#ifdef CONVEX_SOLIDS
layout(std430, binding = BIND_SOLIDS) readonly restrict buffer Solids { Solid solids[]; };
layout(std430, binding = BIND_PLANES) readonly restrict buffer Planes { vec4 planes[]; };
#endif
layout(std430, binding = BIND_OBJECTS) readonly restrict buffer Objects { Object objects[]; };
layout(std430, binding = BIND_SPECTRA) readonly restrict buffer Spectra { float spectra[]; };

// A spectral table's row at the spectral coordinate x, linear between samples.
float spectral_row(uint row, float x)
{
    float at = clamp(x, 0.0, 1.0) * float(SPECTRAL_SAMPLES - 1);
    uint cell = min(uint(at), uint(SPECTRAL_SAMPLES - 2));
    uint base = row * uint(SPECTRAL_SAMPLES) + cell;
    return mix(spectra[base], spectra[base + 1u], at - float(cell));
}

#endif
