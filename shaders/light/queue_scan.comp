// Exclusive prefix sums of the chunk counts by one work group, and the next step's dispatch sizes. The children become
// the rays of the next step: what lists them goes by `dispatched` and `next_alive`.
layout(local_size_x = 256) in;

#include "lib/queue.glsl"

shared uint ray_sums[256];
shared uint photon_sums[256];

void main() {
    uint lane = gl_LocalInvocationID.x;
    uint chunks = (state.alive + CHUNK - 1u) / CHUNK;
    uint span = (chunks + 255u) / 256u;
    uint first = min(lane * span, chunks), end = min(first + span, chunks);
    uint rays = 0u, photons = 0u;
    for (uint c = first; c < end; ++c) {
        rays += counts[c].rays;
        photons += counts[c].photons;
    }
    ray_sums[lane] = rays;
    photon_sums[lane] = photons;
    barrier();
    for (uint step = 1u; step < 256u; step *= 2u) {
        uint below_rays = lane >= step ? ray_sums[lane - step] : 0u;
        uint below_photons = lane >= step ? photon_sums[lane - step] : 0u;
        barrier();
        ray_sums[lane] += below_rays;
        photon_sums[lane] += below_photons;
        barrier();
    }
    uint ray_base = ray_sums[lane] - rays, photon_base = photon_sums[lane] - photons;
    for (uint c = first; c < end; ++c) {
        counts[c].ray_base = ray_base;
        counts[c].photon_base = photon_base;
        ray_base += counts[c].rays;
        photon_base += counts[c].photons;
    }
    if (lane == 255u) {
        uint alive = ray_sums[255], landed = photon_sums[255];
        state.dispatched = state.alive;
        state.overflow += alive - min(alive, state.ray_capacity);
        state.next_alive = min(alive, state.ray_capacity);
        state.photon_first += state.photons_new;
        uint room = state.photon_capacity - state.photon_first;
        state.overflow += landed - min(landed, room);
        state.photons_new = min(landed, room);
        state.trace_groups = uvec4((state.next_alive + 63u) / 64u, 1u, 1u, 0u);
        state.chunk_groups = uvec4((chunks + 63u) / 64u, 1u, 1u, 0u);
        state.next_chunk_groups = uvec4(((state.next_alive + CHUNK - 1u) / CHUNK + 63u) / 64u, 1u, 1u, 0u);
        state.alive = state.next_alive;
        state.flights += state.alive;
        state.gather_groups = uvec4((state.photons_new + 63u) / 64u, 1u, 1u, 0u);
    }
}
