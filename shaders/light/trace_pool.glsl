// Rays in a pool of slots, of which each keeps its own while it is followed from event to event: the other child of a
// surface takes a free one. Free slots stand in a ring, taken in front and given back behind; those that a dispatch
// takes hold the rays that are new in the next one. What a dispatch gives back is free from the next one on. Where none
// is free a ray waits in its slot, before the event.

#include "lib/pool.glsl"

layout(std430, binding = BIND_RAYS_IN) restrict buffer Rays { uvec4 rays_in[]; };
layout(std430, binding = BIND_PHOTONS) writeonly restrict buffer Photons { uvec4 photons[]; };
#define rays_out rays_in
// A photon lies in its ray's slot, which is no smaller, until its group has found room for all of them.
#define photon_slots rays_in
#define PHOTON_STRIDE RayRecord_TEXELS

const uint schedule[DISPATCHES] = uint[DISPATCHES](RAY_EVENTS);
uint events;  // that a ray is followed for
// In the last dispatch an invocation follows all that becomes of its ray; after so many events whatever is left ends.
bool ends_all;

// The ray of this invocation.
uint ray_slot;
bool ray_goes_on;
uint events_done = 0u;
// In free slots that are only lent, linked: children that wait for the ray's end.
uint held_slot = NONE;
bool is_held = false;

void find_ray(uint k) {
    uint dispatch = min(state.dispatches, uint(DISPATCHES) - 1u);
    events = schedule[dispatch];
    ends_all = dispatch == uint(DISPATCHES) - 1u;
    ray_goes_on = k < state.alive;
    ray_slot = !ray_goes_on   ? NONE
        : k < state.survivors ? pool_slots[listed_at(0u, k)]
                              : free_slot(state.born_first + k - state.survivors);
}

// Where the second child goes.
uint second_slot;

// A free slot; NONE: there is none.
uint taken_slot() {
    if (!ends_all) {
        uint taken = atomicAdd(state.taken, 1u);
        return taken < state.free_end ? free_slot(taken) : NONE;
    }
    uint lent = atomicAdd(state.lent, 1u) + 1u;
    if (lent > state.free_end - state.taken) return NONE;
    uint slot = free_slot(state.free_end - lent);
    pool_slots[link_at(slot)] = held_slot;
    held_slot = slot;
    return slot;
}

// Where the first child goes; NONE: it has to wait. Of two that there may be (`both`) the one that `stays` keeps its
// parent's slot and is followed: the stronger one, or long paths would take a dispatch for every surface.
uint first_place(uint slot, bool both, bool stays) {
    if (both) {
        uint other = taken_slot();
        if (other == NONE || !stays) return other;
        second_slot = other;
    }
    ray_goes_on = true;
    return slot;
}

uint second_place(uint slot) {
    ray_goes_on = ray_goes_on || second_slot == slot;
    return second_slot;
}

uint most_depth() { return ends_all && events_done >= events ? 0u : p.max_depth; }

#define RETURNED 0
#define KEPT 1
#define LANDED 2
#define HELD 3
shared uint group_counts[4];
shared uint group_begins[4];

// Hands rays on once they have been followed; where one `lands`, its photon goes behind all others.
void hand_on_rays(bool lands) {
    uint lane = gl_LocalInvocationIndex;
    barrier();
    if (lane < 4u) group_counts[lane] = 0u;
    barrier();
    bool is_kept = ray_slot != NONE && !is_held, is_lost = ends_all && ray_goes_on;
    uint rank = 0u, photon = 0u;
    if (is_lost) atomicAdd(state.overflow, 1u);
    if (is_kept) rank = atomicAdd(group_counts[ray_goes_on && !is_lost ? KEPT : RETURNED], 1u);
    if (lands) photon = atomicAdd(group_counts[LANDED], 1u);
    if (held_slot != NONE) atomicAdd(group_counts[HELD], 1u);
    barrier();
    if (lane == 0u) {
        group_begins[RETURNED] = atomicAdd(state.returned, group_counts[RETURNED]);
        group_begins[KEPT] = atomicAdd(state.next_survivors, group_counts[KEPT]);
        group_begins[LANDED] = atomicAdd(state.photons, group_counts[LANDED]);
    }
    barrier();
    if (is_kept) {
        if (ray_goes_on && !is_lost)
            pool_slots[listed_at(1u, group_begins[KEPT] + rank)] = ray_slot;
        else
            pool_slots[ring_at(group_begins[RETURNED] + rank)] = ray_slot;
    }
    photon += group_begins[LANDED];
    if (lands && photon < state.photon_capacity) {
        for (uint i = 0u; i < uint(PhotonRecord_TEXELS); ++i)
            photons[photon * uint(PhotonRecord_TEXELS) + i] = rays_in[ray_slot * uint(RayRecord_TEXELS) + i];
    }
}

// The next of the children that wait. Whether any of the group has one.
bool find_held() {
    ray_slot = held_slot;
    is_held = true;
    ray_goes_on = held_slot != NONE;
    if (ray_goes_on) held_slot = pool_slots[link_at(held_slot)];
    return group_counts[HELD] > 0u;
}
