// The list of pixels that see glass or mirrors first, and behind it what a survey keeps of all pixels.

// How many pixels are listed, how many of their paths have halted, and what is to be known of the listed ones.
layout(std430, binding = BIND_LISTED) restrict buffer Listed {
    uint listed_count;
    uint halted_count;
    uint listed[];
};

// A listed pixel: its number, the primary sample that goes on, and of how many it is one.
const uint LISTED_BITS = 27u;
uint listed_entry(uint number, uint primary_sample, uint count) {
    return number | (primary_sample << LISTED_BITS) | ((count - 1u) << (LISTED_BITS + 3u));
}

// Looks of one sample at what is seen directly, which costs little, have places of their own. Those that meet something
// specular go on as one of them, chosen by chance; as the sample itself, which lies at one of them, where all do.
#define THE_SAMPLE 4u

// Values of `survey` among the parameters.
const uint SURVEY_TAKES = 1u, SURVEY_KEPT = 2u;
// What a pixel's looks have in common, in a key's lowest bits. A key of 0: nothing, or its neighbours see other things.
const uint SEES_DIRECTLY = 1u, SEES_SPECULAR = 2u, SEES_COATED = 3u, KIND_BITS = 3u;

// Where the survey of a pixel lies: its key, and three words of what its looks saw.
uint survey_place(uint number) { return p.survey_at + 4u * number; }

vec3 surveyed_mean(uint number) {
    uint at = survey_place(number);
    return uintBitsToFloat(uvec3(listed[at + 1u], listed[at + 2u], listed[at + 3u]));
}
