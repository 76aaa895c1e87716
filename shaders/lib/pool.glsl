// A batch's state where several events are followed in a dispatch (light/trace_pool.glsl): what all groups count
// together, and each group's tally of flux.

layout(std430, binding = BIND_STATE) restrict buffer StateBlock { PoolState state; };
layout(std430, binding = BIND_COUNTS) restrict buffer Tallies { PoolTally tallies[]; };
layout(std430, binding = BIND_POOL_SLOTS) restrict buffer PoolSlots { uint pool_slots[]; };

// Lists of rays that stay from one dispatch to the next take turns; `later` 1: the next one's. The ring behind them has
// twice as many places as slots, or one would be given back where another that is new has not been found yet.
uint listed_at(uint later, uint k) { return ((state.dispatches + later) & 1u) * state.capacity + k; }
uint ring_at(uint place) { return 2u * state.capacity + place % (2u * state.capacity); }
// Where an invocation follows all that becomes of its ray, none stays: their list is free.
uint link_at(uint slot) { return listed_at(1u, slot); }

// At first every slot is free, in order.
uint free_slot(uint place) { return place < state.capacity ? place : pool_slots[ring_at(place)]; }

#define ABSORBED_ROW CATEGORY_COUNT
#define ROULETTE_ROW (CATEGORY_COUNT + 1u)
#define EMITTED_ROW (CATEGORY_COUNT + 2u)
#define TALLY_ROWS (CATEGORY_COUNT + 3u)

shared float group_watts[TALLY_ROWS * 64u];  // a column an invocation
shared uint group_falls[FALLBACK_COUNT];
shared uint group_events;

void open_tally() {
    uint lane = gl_LocalInvocationIndex;
    for (uint row = 0u; row < TALLY_ROWS; ++row) group_watts[row * 64u + lane] = 0.0;
    if (lane < FALLBACK_COUNT) group_falls[lane] = 0u;
    if (lane == 0u) group_events = 0u;
    barrier();
}

void count_watts(uint row, float watts) { group_watts[row * 64u + gl_LocalInvocationIndex] += watts; }

void count_outcome(Outcome outcome) {
    count_watts((outcome.what >> 16u) & 0xffu, outcome.flux_w);
    count_watts(ABSORBED_ROW, outcome.absorbed_w);
    count_watts(ROULETTE_ROW, outcome.roulette_w);
    uint falls = (outcome.what >> 8u) & 0xffu;
    for (uint fall = 0u; falls != 0u && fall < FALLBACK_COUNT; ++fall)
        if ((falls & (1u << fall)) != 0u) atomicAdd(group_falls[fall], 1u);
}

// Adds the group's tally to its own, which no other group touches. The last group of a dispatch makes its counts those
// of the next one, in which all rays are new that were emitted (`emits`), by this light and by those before it.
void close_group(bool emits) {
    uint lane = gl_LocalInvocationIndex;
    memoryBarrierBuffer();
    barrier();
    if (lane < TALLY_ROWS) {
        float sum = 0.0;
        // Two short loops, which are unrolled: llvmpipe ends loops that run once others have run too long.
        for (uint i = 0u; i < 64u; i += 8u)
            for (uint j = 0u; j < 8u; ++j) sum += group_watts[lane * 64u + i + j];
        tallies[gl_WorkGroupID.x].watts[lane] += sum;
    }
    if (lane < FALLBACK_COUNT) tallies[gl_WorkGroupID.x].fallbacks[lane] += group_falls[lane];
    if (lane == 0u) atomicAdd(state.flights, group_events);
    if (lane != 0u || atomicAdd(state.groups_done, 1u) + 1u < gl_NumWorkGroups.x) return;
    uint wanted = atomicAdd(state.taken, 0u), taken = min(wanted, state.free_end);
    if (emits) state.overflow += wanted - taken;
    state.born_first = emits ? 0u : state.taken_before;
    state.taken = state.taken_before = taken;
    state.free_end = atomicAdd(state.returned, 0u);
    state.survivors = atomicExchange(state.next_survivors, 0u);
    state.alive = state.survivors + taken - state.born_first;
    state.trace_groups = uvec4((state.alive + 63u) / 64u, 1u, 1u, 0u);
    state.lent = state.groups_done = 0u;
    state.dispatches += uint(!emits);
}
