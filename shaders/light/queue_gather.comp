// Moves the landed photons of this step behind those of earlier steps, and hands the queue on.
layout(local_size_x = 64) in;

#include "lib/queue.glsl"

layout(std430, binding = BIND_PHOTON_SLOTS) readonly restrict buffer PhotonSlots { uvec4 photon_slots[]; };
layout(std430, binding = BIND_PHOTONS) writeonly restrict buffer Photons { uvec4 photons[]; };

void main() {
    uint j = gl_GlobalInvocationID.x;
    if (j >= state.photons_new) return;
    uint to = (state.photon_first + j) * uint(PhotonRecord_TEXELS),
         from = indices[state.ray_capacity + j] * uint(PhotonRecord_TEXELS);
    for (uint i = 0u; i < uint(PhotonRecord_TEXELS); ++i) photons[to + i] = photon_slots[from + i];
}
