// What splats are added to (splat_add.comp), and taken from into the textures of the maps (splat_sums.comp): in each
// target blocks of 4 by 2 texels, in which each channel's eight values lie side by side, as many as a device's memory
// is given at once.
#if FLOAT_ATOMICS
layout(std430, binding = 2) buffer Sums { float splat_sums[]; };
#define NOTHING 0.0
float sum_at(uint place) { return splat_sums[place]; }
#else
layout(std430, binding = 2) buffer Sums { uint splat_sums[]; };
#define NOTHING 0u
float sum_at(uint place) { return uintBitsToFloat(splat_sums[place]); }
#endif

#define CHANNEL_STEP 8u

// Where a texel's first channel lies; the others follow in steps.
uint place_in_sums(ivec2 texel, ivec2 size, int target) {
    uvec2 at = uvec2(texel), blocks = (uvec2(size) + uvec2(3u, 1u)) / uvec2(4u, 2u);
    uint block = (uint(target) * blocks.y + at.y / 2u) * blocks.x + at.x / 4u;
    return block * (4u * CHANNEL_STEP) + (at.y & 1u) * 4u + (at.x & 3u);
}

vec4 sums_at(ivec2 texel, ivec2 size, int target) {
    uint place = place_in_sums(texel, size, target);
    return vec4(sum_at(place), sum_at(place + CHANNEL_STEP), sum_at(place + 2u * CHANNEL_STEP),
        sum_at(place + 3u * CHANNEL_STEP));
}

void add_to_sum(uint place, float value) {
    // Most channels far from a splat's middle round to nothing.
    if (value == 0.0) return;
    if (FLOAT_ATOMICS) {
        atomicAdd(splat_sums[place], value);
    } else {
        uint expected, found = splat_sums[place];
        do {
            expected = found;
            found = atomicCompSwap(splat_sums[place], expected, floatBitsToUint(uintBitsToFloat(expected) + value));
        } while (found != expected);
    }
}

void add_to_sums(ivec2 texel, ivec2 size, int target, vec4 value) {
    uint place = place_in_sums(texel, size, target);
    add_to_sum(place, value.x);
    add_to_sum(place + CHANNEL_STEP, value.y);
    add_to_sum(place + 2u * CHANNEL_STEP, value.z);
    add_to_sum(place + 3u * CHANNEL_STEP, value.w);
}
