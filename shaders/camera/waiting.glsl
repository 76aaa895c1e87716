// The paths of a sample wait in a buffer: an invocation holds the one that it follows.
//
// With HALTS, a sample whose loops have run long halts between two surfaces, and another dispatch takes it up again.
// llvmpipe ends all loops of the invocations that it runs side by side (eight, with AVX2) without a word once these
// have run 65,535 rounds together: what a path found would then depend on which pixels happen to be its neighbours.
// Whatever a sample knows goes along, and nothing is added to the picture before its end: where it halts changes no bit
// of it. A GPU has no such limit, and no halts.

// Ends of paths are looked up together, when there are that many or no path is left: a software renderer, and a GPU,
// then looks up those of neighbouring pixels side by side.
struct PathEnd {
    Path path;
    Hit hit;
    uint met;  // 1: `hit` was met
    uint same_hit;
};

// A sample has a place of its own from its start to its end.
struct Waiting {
    uint queued[2];  // places of the samples that have halted: two queues, one is read while the other is written
    uint entry;  // of the list
    int stack_size;
    int events;
    int asked;
    bool took_turn;
    vec4 radiance[TARGETS];
    Path path_stack[STACK + 1];
#if !HALTS
    PathEnd ended[ENDS_HELD];
#endif
};
layout(std430, binding = BIND_WAITING) restrict buffer WaitingPaths { Waiting waiting[]; };
uint place;

#if HALTS  // on a software renderer; on a GPU they wait in the buffer
PathEnd ended[ENDS_HELD];
#define ENDED(e) ended[e]
#else
#define ENDED(e) waiting[place].ended[e]
#endif

// Paths that wait while another is followed; global as `radiance` is.
int stack_size;
// Rays traced to find out where paths diverge.
int asked = 0;

void push(Path path) { waiting[place].path_stack[stack_size++] = path; }

Path pop() { return waiting[place].path_stack[--stack_size]; }

// Which of `count` groups the one of this number is: one after the other from each quarter. A software renderer gives
// each of its threads a run of neighbours, and what is listed at the picture's top may take three times as long as what
// is at its bottom.
uint shared_out(uint group, uint count) {
    uint run = count / 4u;
    return group < 4u * run ? group % 4u * run + group / 4u : group;
}

// The path that it was following waits with the others, last.
void halt(uint entry, int events) {
    waiting[atomicAdd(halted_count, 1u)].queued[p.queue] = place;
    waiting[place].entry = entry;
    waiting[place].stack_size = stack_size;
    waiting[place].events = events;
    waiting[place].took_turn = took_turn;
    if (SPECTRAL_SWEEP) waiting[place].asked = asked;
    for (int t = 0; t < TARGETS; ++t) waiting[place].radiance[t] = radiance[t];
}

void resume(out int events) {
    stack_size = waiting[place].stack_size;
    events = waiting[place].events;
    took_turn = waiting[place].took_turn;
    if (SPECTRAL_SWEEP) asked = waiting[place].asked;
    for (int t = 0; t < TARGETS; ++t) radiance[t] = waiting[place].radiance[t];
}

// Whether loops still run, and so many rounds. How many, the compiler does not know.
bool loops_run() {
    uint ran = 0u, wanted = p.primary_samples + 2u;
    for (uint i = 0u; i < wanted; ++i) ran += hash_pcg(ran + i) == 77u ? 2u : 1u;
    return ran >= wanted;
}
