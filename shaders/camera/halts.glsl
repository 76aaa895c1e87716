// A sample whose loops have run long halts between two surfaces, and another dispatch takes it up again. llvmpipe ends
// all loops of the invocations that it runs side by side (eight, with AVX2) without a word once these have run 65,535
// rounds together: what a path found would then depend on which pixels happen to be its neighbours. Whatever a sample
// knows goes along, and nothing is added to the picture before its end: where it halts changes no bit of it. A GPU has
// no such limit, and no halts.

// A sample has a place of its own from its start to its end; its paths wait there.
struct Halted {
    uint queued[2];  // places of the samples that have halted: two queues, one is read while the other is written
    uint entry;  // of the list
    int stack_size;
    int events;
    int asked;
    bool took_turn;
    vec4 radiance[TARGETS];
    Path path_stack[STACK + 1];
};
layout(std430, binding = BIND_HALTED) restrict buffer HaltedSamples { Halted halted[]; };
uint place;

// Which of `count` groups the one of this number is: one after the other from each quarter. A software renderer gives
// each of its threads a run of neighbours, and what is listed at the picture's top may take three times as long as what
// is at its bottom.
uint shared_out(uint group, uint count) {
    uint run = count / 4u;
    return group < 4u * run ? group % 4u * run + group / 4u : group;
}

// The path that it was following waits with the others, last.
void halt(uint entry, int events) {
    halted[atomicAdd(halted_count, 1u)].queued[p.queue] = place;
    halted[place].entry = entry;
    halted[place].stack_size = stack_size;
    halted[place].events = events;
    halted[place].took_turn = took_turn;
    if (SPECTRAL_SWEEP) halted[place].asked = asked;
    for (int t = 0; t < TARGETS; ++t) halted[place].radiance[t] = radiance[t];
}

void resume(out int events) {
    stack_size = halted[place].stack_size;
    events = halted[place].events;
    took_turn = halted[place].took_turn;
    if (SPECTRAL_SWEEP) asked = halted[place].asked;
    for (int t = 0; t < TARGETS; ++t) radiance[t] = halted[place].radiance[t];
}

// Whether loops still run, and so many rounds. How many, the compiler does not know.
bool loops_run() {
    uint ran = 0u, wanted = p.primary_samples + 2u + uint(SPARE_ROUNDS);
    for (uint i = 0u; i < wanted; ++i) ran += hash_pcg(ran + i) == 77u ? 2u : 1u;
    return ran >= wanted;
}
