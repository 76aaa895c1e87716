// Lists the slots of living children (then of photons, after `ray_capacity`) in order.
layout(local_size_x = 64) in;

#include "lib/queue.glsl"

void main() {
    uint chunk = gl_GlobalInvocationID.x;
    uint first = chunk * CHUNK;
    if (first < state.dispatched) {
        uint end = min(first + CHUNK, state.dispatched);
        uint ray_at = counts[chunk].ray_base, photon_at = counts[chunk].photon_base;
        // First the refracted children, then the reflected ones: neighbours in a work group go the same way.
        for (uint k = first; k < end; ++k) {
            uint what = outcomes[k].x;
            if ((what & 2u) != 0u && ray_at < state.next_alive) indices[ray_at++] = 2u * k + 1u;
            if ((what & 4u) != 0u && photon_at < state.photons_new) indices[state.ray_capacity + photon_at++] = k;
        }
        for (uint k = first; k < end; ++k)
            if ((outcomes[k].x & 1u) != 0u && ray_at < state.next_alive) indices[ray_at++] = 2u * k;
    }
}
