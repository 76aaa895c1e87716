// Moves the landed photons of this step behind those of earlier steps, and hands the queue on.
layout(local_size_x = 64) in;

#include "lib/queue.glsl"

layout(std430, binding = BIND_PHOTON_SLOTS) readonly restrict buffer PhotonSlots { PhotonRecord photon_slots[]; };
layout(std430, binding = BIND_PHOTONS) writeonly restrict buffer Photons { PhotonRecord photons[]; };

void main()
{
    uint j = gl_GlobalInvocationID.x;
    if (j < state.photons_new) photons[state.photon_first + j] = photon_slots[indices[state.ray_capacity + j]];
}
