// Sums up the tallies of all groups of a batch, which begin again at nothing, and says how many photons are to be
// drawn: none of a batch that has not ended or whose photons found no room, which is traced again.
layout(local_size_x = 256) in;

#include "lib/pool.glsl"

shared uint falls[FALLBACK_COUNT];
shared float parts[256];

void main() {
    uint lane = gl_LocalInvocationID.x;
    if (lane < FALLBACK_COUNT) falls[lane] = 0u;
    barrier();
    float watts[TALLY_ROWS];
    for (uint row = 0u; row < TALLY_ROWS; ++row) watts[row] = 0.0;
    for (uint group = lane; group < uint(tallies.length()); group += 256u) {
        for (uint row = 0u; row < TALLY_ROWS; ++row) {
            watts[row] += tallies[group].watts[row];
            tallies[group].watts[row] = 0.0;
        }
        for (uint fall = 0u; fall < FALLBACK_COUNT; ++fall) {
            atomicAdd(falls[fall], tallies[group].fallbacks[fall]);
            tallies[group].fallbacks[fall] = 0u;
        }
    }
    for (uint row = 0u; row < TALLY_ROWS; ++row) {
        barrier();
        parts[lane] = watts[row];
        for (uint half_count = 128u; half_count > 0u; half_count /= 2u) {
            barrier();
            if (lane < half_count) parts[lane] += parts[lane + half_count];
        }
        if (lane == 0u) state.watts[row] = parts[0];
    }
    if (lane < FALLBACK_COUNT) state.fallbacks[lane] = falls[lane];
    if (lane == 0u) {
        uint overflow = state.overflow + state.alive + state.photons - min(state.photons, state.photon_capacity);
        state.overflow = overflow;
        state.drawn = overflow > 0u ? 0u : state.photons;
    }
}
