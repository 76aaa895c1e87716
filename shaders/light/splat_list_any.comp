// Lists the splats of each kind in any order, and how many work groups add them (splat_add.comp): many photons at a
// time, for what is summed with atomics anyway. Each work group takes room in the lists for all of its own at once.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = 1) readonly buffer Splats { SplatRecord splats[]; };
layout(std430, binding = 7) buffer Commands { uint dispatch_words[5 * KINDS]; };
layout(std430, binding = 8) writeonly buffer Lists { uint lists[]; };  // `capacity` a kind

uniform uint capacity;

shared uint listed[KINDS];
shared uint begins[KINDS];

#include "light/footprint_parameters.glsl"
#include "light/splat_slots.glsl"

void main() {
    uint me = gl_LocalInvocationID.x, photon = gl_GlobalInvocationID.x;
    if (me < KINDS) listed[me] = 0u;
    barrier();
    uint slot = photon * PHOTON_SLOTS, end = photon < photons_there() ? end_of(photon) : slot;
    for (uint s = slot; s < end; ++s) {
        uint kind = splats[s].kind;
        if (kind > 0u) atomicAdd(listed[kind - 1u], 1u);
    }
    barrier();
    if (me < KINDS && listed[me] > 0u) {
        begins[me] = atomicAdd(dispatch_words[5u * me + 4u], listed[me]);
        atomicMax(dispatch_words[5u * me], min(begins[me] + listed[me], MOST_GROUPS));
    }
    barrier();
    for (uint s = slot; s < end; ++s) {
        uint kind = splats[s].kind;
        if (kind > 0u) lists[(kind - 1u) * capacity + atomicAdd(begins[kind - 1u], 1u)] = s;
    }
}
