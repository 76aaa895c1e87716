// Some of a batch's photons, evenly chosen: where they landed, and with how much flux.
layout(local_size_x = WORKGROUP) in;
layout(std430, binding = 0) readonly restrict buffer Photons { uvec4 photon_texels[]; };
#define LOAD_PHOTON(at) photon_texels[at]
layout(std430, binding = 1) writeonly restrict buffer Landings { uint landings[]; };
layout(std430, binding = 2) readonly restrict buffer Held { uint held[]; };
uniform uint held_at;  // which word of the buffer counts the photons
uniform uint first;  // place of the batch's first one among those chosen
uniform uint chosen;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= chosen) return;
    uint count = held[held_at], at = (first + i) * 5u;
    uint number = min(uint(float(count) * (float(i) + 0.5) / float(chosen)), max(count, 1u) - 1u);
    PhotonRecord photon = PhotonRecord_FROM(LOAD_PHOTON, number * uint(PhotonRecord_TEXELS));
    landings[at] = floatBitsToUint(photon.position.x);
    landings[at + 1u] = floatBitsToUint(photon.position.y);
    landings[at + 2u] = floatBitsToUint(photon.position.z);
    landings[at + 3u] = count > 0u ? floatBitsToUint(photon.flux_w) : 0u;
    landings[at + 4u] = photon.receiver;
}
