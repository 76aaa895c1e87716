// Lines that a splat's light must not cross, for `footprint.comp`: where its light's emission ends (lib/edge.glsl), a
// line of the lattice that it comes from, and where something stands on its receiver (lib/contact.glsl), a line on the
// camera's pixels. The splat is drawn on its own side alone, brighter by what it would have had on the other.

// Spacings by which wavelengths and texels blur the edge at most for the splat to be cut off there, and of footprints'
// widths.
const float BLURRED_EDGE = 0.4;
const float WIDEST_CUT = 0.5;

// Where the light's emission ends the splat is cut off, as bright as if all of it were lit; the photon carries its lit
// share. At a fragment are the wavelengths that land about `share` of its way along the sweep (as in
// `flatten_lattice`).
void cut_at_edge(inout SplatRecord splat, Blur blur, Footprint f, uint word) {
    vec3 edge = unpacked_edge(word);
    float area = f.axis_s.x * f.axis_t.y - f.axis_s.y * f.axis_t.x;
    if (abs(area) < 1e-6 || smoothing >= WIDEST_CUT || stride != 1u) return;
    vec2 per_texel =
        f.per_spacing / area * (edge.x * vec2(f.axis_t.y, -f.axis_t.x) + edge.y * vec2(-f.axis_s.y, f.axis_s.x));
    float own = blur.along2, swept = blur.sweep * blur.sweep * TEXEL_VARIANCE, share = swept / (own + swept);
    float along = dot(per_texel, blur.e),
          variance = dot(per_texel, per_texel) * TEXEL_VARIANCE + along * along * share * own;
    if (variance > BLURRED_EDGE * BLURRED_EDGE) return;
    float sharpness = sqrt(TEXEL_VARIANCE / max(variance, 1e-12));
    splat.lit = 0.5 + sharpness * edge.z;
    splat.x_range = sharpness * vec2((1.0 - share) * dot(per_texel, splat.along), dot(per_texel, splat.across));
    splat.amplitude /= lit_share(edge.z);
}

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

// Draws a splat on this side of a line of contact alone (0: there is none), where texels of that side hold the share
// `held` of it. A swept splat that a line or its rectangle cuts, or that fans out, is drawn by a program of its own:
// asking every fragment costs a tenth of the rate.
void keep_within_lines(inout SplatRecord splat, uint side, float held) {
    vec2 extent = half_extent(splat);
    bool whole = side == 0u && splat.fan == vec2(0.0) && all(greaterThanEqual(splat.centre - extent, splat.rect.xy))
        && all(lessThanEqual(splat.centre + extent, splat.rect.zw));
    if (LIGHT_EDGES) whole = whole && splat.x_range == vec2(0.0);
    if (splat.kind == 2u && !whole) splat.kind = 4u;
    if (CONTACT_LINES && side != 0u) {
        splat.layer |= side << 30u;
        splat.amplitude /= held;
    }
}
