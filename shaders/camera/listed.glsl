// The list of pixels that see glass or mirrors first, and behind it what a survey keeps of all pixels, and the list of
// those that are not even. Dispatches over lists take their sizes from here.

// Invocations that follow listed pixels side by side; one that is done with its own takes the next that has none.
const uint PLACES = uint(PATHS_AT_ONCE);
// Groups of a row of those that are not even, for there may be more than fit one dimension.
const uint UNEVEN_ROW = 64u;

// Groups and number of the listed pixels, the same of those that are not even, how many samples have halted, how many
// listed pixels were taken by invocations that were done with their own, and what is to be known of the listed ones.
layout(std430, binding = BIND_LISTED) restrict buffer Listed {
    uint listed_groups[3];
    uint listed_count;
    uint uneven_groups[3];
    uint uneven_count;
    uint halted_count;
    uint taken_count;
    uint listed[];
};

// A listed pixel: its number, the primary sample that goes on, and of how many it is one.
const uint LISTED_BITS = 27u;
uint listed_entry(uint number, uint primary_sample, uint count) {
    return number | (primary_sample << LISTED_BITS) | ((count - 1u) << (LISTED_BITS + 3u));
}

void list_entry(uint entry) {
    uint at = atomicAdd(listed_count, 1u);
    if (at < PLACES && at % uint(PATHS_GROUP) == 0u) atomicAdd(listed_groups[0], 1u);
    listed[at] = entry;
}

// Looks of one sample at what is seen directly, which costs little, have places of their own. Those that meet something
// specular go on as one of them, chosen by chance; as the sample itself, which lies at one of them, where all do.
#define THE_SAMPLE 4u

// Values of `survey` among the parameters.
const uint SURVEY_TAKES = 1u, SURVEY_KEPT = 2u;
// What a pixel's looks have in common, in a key's lowest bits; a key of 0: nothing.
const uint SEES_DIRECTLY = 1u, SEES_SPECULAR = 2u, SEES_COATED = 3u, KIND_BITS = 3u;
// Flag in a key: the neighbours have the same.
const uint IS_EVEN = 4u, KEY_FLAGS = KIND_BITS | IS_EVEN;

// Where the survey of a pixel lies: its key, and three words of what its looks saw.
uint survey_place(uint number) { return p.survey_at + 4u * number; }

vec3 surveyed_mean(uint number) {
    uint at = survey_place(number);
    return uintBitsToFloat(uvec3(listed[at + 1u], listed[at + 2u], listed[at + 3u]));
}

// Where a pixel that is not even is listed.
uint uneven_place(uint at) { return p.survey_at + 4u * p.size.x * p.size.y + at; }
