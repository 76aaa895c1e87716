// Whether a number is one, told by its bits. Compilers may take for granted that there is no NaN: isnan() is then
// false, and !(a < b) becomes a >= b. As integers, magnitudes of floats are ordered as the floats are, with infinity
// and then NaN above all.
#define INFINITY_BITS 0x7f800000u

uint magnitude_bits(float v) { return floatBitsToUint(v) & 0x7fffffffu; }

// Neither infinite nor NaN.
bool is_finite(float v) { return magnitude_bits(v) < INFINITY_BITS; }
bool is_finite3(vec3 v) { return all(lessThan(floatBitsToUint(v) & 0x7fffffffu, uvec3(INFINITY_BITS))); }

// |v| < limit, in every component.
bool is_within(float v, float limit) { return magnitude_bits(v) < floatBitsToUint(limit); }
bool is_within2(vec2 v, float limit) {
    return all(lessThan(floatBitsToUint(v) & 0x7fffffffu, uvec2(floatBitsToUint(limit))));
}
