// Where something stands on a receiver, as the camera sees it: one word for each texel of a map on a picture's pixels.
// Its low half has a bit for each of the texel's parts in which the receiver is seen, its high half one for each in
// which something is seen that stands close before the receiver: light beneath it and beside it may have nothing in
// common, so a texel in which both are seen keeps what falls on the seen parts.

#define SEEN_SIDE 1u
#define HIDDEN_SIDE 2u

const uint CONTACT_PARTS = 4u;  // along a texel's side
const float PARTS_OF_TEXEL = 16.0;

float seen_share(uint word) { return float(bitCount(word & 0xffffu)) / PARTS_OF_TEXEL; }

bool is_contact(uint word) { return (word >> 16u) != 0u; }

// On which side of the line a place within a texel lies, 0 to 1.
uint side_of(uint word, vec2 within) {
    uvec2 part = min(uvec2(max(within, vec2(0.0)) * float(CONTACT_PARTS)), uvec2(CONTACT_PARTS - 1u));
    return ((word >> (part.y * CONTACT_PARTS + part.x)) & 1u) != 0u ? SEEN_SIDE : HIDDEN_SIDE;
}

// Whether a texel takes light of this side, or of a splat that no line is near (0).
float takes_side(uint word, uint side) {
    bool sees = (word & 0xffffu) != 0u;
    return side == 0u || (side == SEEN_SIDE) == sees ? 1.0 : 0.0;
}

// Energy of a side that a texel holds, of what is drawn into it as if all of it were on that side.
float held_share(uint word, uint side) { return side == SEEN_SIDE ? seen_share(word) : takes_side(word, side); }

// Middle of a part, about the texel's own, in texels.
vec2 part_place(uint part) {
    return (vec2(float(part % CONTACT_PARTS), float(part / CONTACT_PARTS)) + 0.5) / float(CONTACT_PARTS) - 0.5;
}
