// The children become the rays of the next step.
layout(local_size_x = 1) in;

#include "lib/queue.glsl"

void main()
{
    state.alive = state.next_alive;
    state.flights += state.alive;
    state.most_alive = max(state.most_alive, state.alive);
    state.iterations += state.alive > 0u ? 1u : 0u;
}
