// On which side of a line of contact a splat's light landed (lib/contact.glsl): it is drawn into texels of that side
// alone, all of it.

// Footprints of a larger standard deviation are drawn across lines of contact, in wider texels.
const float CONTACT_VARIANCE = 256.0;
const int CONTACT_LOOKS = 16;
// Of its light that a splat may lose to texels of the other side before it grows no brighter for that.
const float LEAST_HELD = 0.1;

uint contact_word(Placement place, vec2 at) {
    return texelFetch(contact_words, ivec2(clamp(at, place.rect.xy, place.rect.zw - 1.0)), 0).x;
}

uint side_at(Placement place, vec2 at) { return side_of(contact_word(place, at), fract(at)); }

// The side, where the splat's texels hold such a line and all of its spectrum is on one side, else 0; and the share of
// its energy that texels there hold, and the share that none does. Looks are points of its Gaussian, turned from photon
// to photon.
uint side_of_contact(Placement place, Footprint f, uint key, out float held, out float lost) {
    held = 1.0;
    lost = 0.0;
    if (place.kind != PLACED_PICTURE || thin_variance(f) > CONTACT_VARIANCE) return 0u;
    uint side = side_at(place, f.centre);
    if (side_at(place, f.centre - 0.5 * f.chord) != side || side_at(place, f.centre + 0.5 * f.chord) != side) return 0u;
    float turn = float(key * 2654435769u) * (TWO_PI / 4294967296.0), sum = 0.0;
    bool touches_contact = false;
    for (int i = 0; i < CONTACT_LOOKS; ++i) {
        float share = (float(i) + 0.5) / float(CONTACT_LOOKS), angle = turn + 2.39996323 * float(i);
        vec2 normal = sqrt(-2.0 * log(share)) * vec2(cos(angle), sin(angle));
        float along = fract(float(i) * 0.61803399 + turn) - 0.5;
        uint word = contact_word(place, f.centre + normal.x * f.axis_s + normal.y * f.axis_t + along * f.chord);
        touches_contact = touches_contact || is_contact(word);
        sum += held_share(word, side);
    }
    held = max(sum / float(CONTACT_LOOKS), LEAST_HELD);
    lost = touches_contact ? 1.0 - sum / float(CONTACT_LOOKS) / held : 0.0;
    return touches_contact ? side : 0u;
}

void keep_to_side(inout SplatRecord splat, uint side, float held) {
    if (side == 0u || splat.kind == 0u) return;
    splat.layer |= side << 30u;
    splat.amplitude /= held;
    splat.kind = splat.kind == 1u ? 5u : splat.kind == 3u ? 7u : 6u;
}
