// Lists the splats of each kind in photon order, and how many vertices each kind's draw has: draws then pull only what
// is theirs. One work group, each thread a run of photons: counted, summed over the threads before it, listed. No
// atomics: the order in which splats are added is a function of the photons alone.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = 1) readonly buffer Splats { uvec4 splat_texels[]; };
layout(std430, binding = 7) buffer Commands { uint draw_words[5 * KINDS]; };
layout(std430, binding = 8) writeonly buffer Lists { uint lists[]; };  // `capacity` a kind

uniform uint capacity;

shared uint counts[WORKGROUP * int(KINDS)];

#include "light/footprint_parameters.glsl"
#include "light/splat_slots.glsl"

void main() {
    uint me = gl_LocalInvocationID.x;
    uint photons = photons_there();
    uint run = (photons + uint(WORKGROUP) - 1u) / uint(WORKGROUP);
    uint first = min(me * run, photons), last = min(first + run, photons);
    uint mine[KINDS];
    for (uint k = 0u; k < KINDS; ++k) mine[k] = 0u;
    for (uint photon = first; photon < last; ++photon) {
        uint end = end_of(photon);
        for (uint slot = photon * PHOTON_SLOTS; slot < end; ++slot) {
            uint kind = kind_at(slot);
            for (uint k = 0u; k < KINDS; ++k) mine[k] += kind == k + 1u ? 1u : 0u;
        }
    }
    for (uint k = 0u; k < KINDS; ++k) counts[k * uint(WORKGROUP) + me] = mine[k];
    barrier();
    if (me < KINDS) {
        uint sum = 0u;
        for (uint i = 0u; i < uint(WORKGROUP); ++i) {
            uint count = counts[me * uint(WORKGROUP) + i];
            counts[me * uint(WORKGROUP) + i] = sum;
            sum += count;
        }
        draw_words[5u * me] *= sum;
    }
    barrier();
    for (uint k = 0u; k < KINDS; ++k) mine[k] = k * capacity + counts[k * uint(WORKGROUP) + me];
    for (uint photon = first; photon < last; ++photon) {
        uint end = end_of(photon);
        for (uint slot = photon * PHOTON_SLOTS; slot < end; ++slot) {
            uint kind = kind_at(slot);
            for (uint k = 0u; k < KINDS; ++k) {
                if (kind == k + 1u) {
                    lists[mine[k]] = slot;
                    ++mine[k];
                }
            }
        }
    }
}
