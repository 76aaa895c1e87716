// Living children and photons of each chunk of outcomes, and where flux went.
layout(local_size_x = 64) in;

#include "lib/queue.glsl"

void main() {
    uint chunk = gl_GlobalInvocationID.x;
    uint first = chunk * CHUNK;
    if (first >= state.alive) return;
    uint end = min(first + CHUNK, state.alive);
    ChunkCount total = counts[chunk];
    total.rays = 0u;
    total.photons = 0u;
    for (uint k = first; k < end; ++k) {
        uvec4 texels[Outcome_TEXELS];
        texels[0] = outcomes[k];
        Outcome outcome = Outcome_of(texels);
        bool starts = (outcome.what & 8u) != 0u;
        uint ended_in = starts ? CATEGORY_COUNT : (outcome.what >> 16u) & 0xffu;
        total.rays += (outcome.what & 1u) + ((outcome.what >> 1u) & 1u);
        total.photons += (outcome.what >> 2u) & 1u;
        for (uint category = 0u; category < CATEGORY_COUNT; ++category)
            total.flux_w[category] += ended_in == category ? outcome.flux_w : 0.0;
        total.absorbed_w += outcome.absorbed_w;
        total.roulette_w += outcome.roulette_w;
        total.emitted_w += starts ? outcome.flux_w : 0.0;
        for (uint fall = 0u; fall < FALLBACK_COUNT; ++fall) total.fallbacks[fall] += (outcome.what >> (8u + fall)) & 1u;
    }
    counts[chunk] = total;
}
