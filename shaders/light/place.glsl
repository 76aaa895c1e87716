// Positions within what a place on a receiver stands for: all of a texel, or those of its parts that something covers,
// or does not.

#define PLACE_PARTS 4u  // along a texel's side
#define ALL_PARTS 0xffffu

// `within`: 0 to 1, uniform.
vec3 position_in(EnvironmentPlace place, vec2 within) {
    if (place.parts != ALL_PARTS) {
        float chosen = within.x * float(bitCount(place.parts));
        uint left = place.parts;
        for (uint skipped = uint(chosen); skipped > 0u && (left & (left - 1u)) != 0u; --skipped) left &= left - 1u;
        uint part = uint(findLSB(left));
        within = (vec2(part % PLACE_PARTS, part / PLACE_PARTS) + vec2(fract(chosen), within.y)) / float(PLACE_PARTS);
    }
    return place.position + (within.x - 0.5) * place.step_u + (within.y - 0.5) * place.step_v;
}
