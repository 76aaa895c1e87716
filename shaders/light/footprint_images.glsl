// Images of a footprint beyond its receiver's borders (lib/border.glsl), for `footprint.comp`: each is drawn like the
// photon itself. What of it lies inside is what footprints of photons from beyond would be there; what of it lies
// outside nobody reads, but for texels that the border crosses, which so hold what whole ones would.
//
// Photons of a lattice go on beyond the border as the lattice does: the last one inside stands for the next ones
// outside, a step of its lattice further each. Mirrored, their even lattice would have a seam at the border, with gaps
// from none to two spacings wide. Photons of no lattice are mirrored, those of lattices much finer than texels, those
// whose footprints fan out, and those whose band sweeps towards the border, which blurs the seam.

// A photon as it is drawn.
struct Depicted {
    PhotonRecord photon;
    vec3 middle;  // of the sweep, from the photon
    vec3 sweep;
    float power_w;
    float mean;
    uint table;
    vec4 band;
    uint side;  // of a line of contact, 0: none
    float thin;  // smaller variance where it lands, texels²
};

// What there is to know of a footprint beside a border.
struct Beside {
    vec4 border;
    int index;
    float distance;  // of the sweep's middle, inside of the border
    float reach;  // from so deep inside it reaches over the border; below 0 where it has no image there
    vec3 outwards;  // the step of its lattice that leads over the border fastest; 0 where its image is mirrored
    float outwards_by;
};

// Texels beside a border in which a photon is drawn at least.
const float TEXELS_AT_BORDER = 1.5;
// Steps beyond the border that a photon stands for at most; finer lattices are mirrored.
const uint STEPS_BEYOND = 3u;
const float LEAST_STEP = 0.375;  // texels
// Of such a step: which photon of a lattice is the last one inside depends on the wavelength where a band sweeps
// further towards the border. It is mirrored.
const float MOST_SWEPT = 0.1;
// Change of a footprint's size over such a step: light that thins out so fast (glows at low angles) has no even lattice
// beyond the border, and what those within spread beyond it would be lost.
const float MOST_FANNED = 0.5;
// Bit of the image across both borders, behind the steps over the one and over the other.
const uint ACROSS_BOTH = 2u * STEPS_BEYOND;

Depicted mirrored(Depicted of, vec4 border) {
    of.photon.position = mirrored_place(border, of.photon.position);
    of.photon.dposition_ds = mirrored_step(border, of.photon.dposition_ds);
    of.photon.dposition_dt = mirrored_step(border, of.photon.dposition_dt);
    of.middle = mirrored_step(border, of.middle);
    of.sweep = mirrored_step(border, of.sweep);
    return of;
}

Beside footprint_beside(Depicted of, Placement place, vec4 border, int index) {
    vec3 centre = of.photon.position + of.middle, from = centre - 0.5 * of.sweep, to = from + of.sweep;
    Beside found = Beside(border, index, border_distance(border, centre), -1.0, vec3(0.0), 0.0);
    float spread = smoothing * border_spread(border, of.photon.dposition_ds, of.photon.dposition_dt);
    if (!sweeps_inside(border, from, to, spread)) return found;
    if (CONTACT_LINES) {
        // A footprint that meets a line of contact (splat_lines.glsl) has its light back already: another receiver
        // begins there.
        vec3 at_border = homogeneous_texel(place, centre - found.distance * border.xyz);
        if (place.kind == PLACED_PICTURE && of.thin <= CONTACT_VARIANCE && at_border.z > 0.0) {
            vec2 texel_there = at_border.xy / at_border.z, outwards_there = texels_along(place, at_border, -border.xyz);
            vec2 next_there = texel_there + outwards_there / max(length(outwards_there), 1e-20);
            if (is_contact(contact_word(place, texel_there)) || is_contact(contact_word(place, next_there)))
                return found;
        }
    }
    float texel = 1.0 / max(length(texels_along(place, homogeneous_texel(place, centre), border.xyz)), 1e-20);
    found.reach = CUT * spread + 0.5 * abs(dot(border.xyz, of.sweep)) + TEXELS_AT_BORDER * texel;
    uint lattice = lattice_of(of.photon);
    if (lattice == 0u) return found;
    vec2 step = step_over_border(border, of.photon.dposition_ds, of.photon.dposition_dt, float(lattice));
    vec3 outwards = step.x * of.photon.dposition_ds + step.y * of.photon.dposition_dt;
    found.outwards_by = -dot(border.xyz, outwards);
    float least = max(LEAST_STEP * texel, abs(dot(border.xyz, of.sweep)) / MOST_SWEPT);
    bool fans = abs(dot(unpackHalf2x16(of.photon.fan), step)) > MOST_FANNED;
    found.outwards = found.outwards_by < least || fans ? vec3(0.0) : outwards;
    return found;
}

// Bits of the images over `one` border: of steps beyond it, where those do not belong to the `other`.
uint images_over(Beside one, Beside other, Depicted of) {
    if (one.outwards == vec3(0.0)) return 1u;
    uint images = 0u;
    for (uint k = 0u; k < STEPS_BEYOND; ++k) {
        float steps = float(k + 1u);
        bool is_beyond = one.distance < one.outwards_by && steps * one.outwards_by - one.distance < one.reach;
        // Places beyond both borders are the first one's.
        vec3 place = of.photon.position + of.middle + steps * one.outwards;
        bool is_others = other.index >= 0 && other.index < one.index && border_distance(other.border, place) < 0.0;
        images |= is_beyond && !is_others ? 1u << k : 0u;
    }
    return images;
}

Depicted image_over(Beside one, Depicted of, uint k) {
    if (one.outwards == vec3(0.0)) return mirrored(of, one.border);
    of.photon.position += float(k + 1u) * one.outwards;
    return of;
}

Depicted image_of(Depicted of, Beside first, Beside second, uint bit) {
    if (bit < STEPS_BEYOND) return image_over(first, of, bit);
    if (bit < ACROSS_BOTH) return image_over(second, of, bit - STEPS_BEYOND);
    return mirrored(mirrored(of, first.border), second.border);
}

// Write all images of a photon from `slot` on, in the windows that it is drawn in; returns how many splats those are.
// Their number is found first, so that a software renderer, which runs the body of an `if` for all, goes through the
// loop only with photons that have any; what makes a splat stands there once.
uint put_images(Depicted of, uint at, uint slot) {
    Placement read_in = placements[at];
    for (int level = 1; level < SLOTS && read_in.next != NONE; ++level) {
        vec3 middle = homogeneous_texel(read_in, of.photon.position + of.middle);
        if (middle.z > 0.0 && contains(read_in.rect, middle.xy / middle.z, 0.0)) break;
        read_in = placements[read_in.next];
    }
    // The two borders of those that it reaches over to which it is nearest.
    Beside first = Beside(vec4(0.0), -1, 1e30, -1.0, vec3(0.0), 0.0), second = first;
    int most = textureSize(borders, 0).x;
    for (int k = 0; k < most; ++k) {
        vec4 border = texelFetch(borders, ivec2(k, of.photon.receiver), 0);
        if (border.xyz == vec3(0.0)) break;
        Beside found = footprint_beside(of, read_in, border, k);
        if (found.distance >= found.reach || found.distance >= second.distance) continue;
        bool is_first = found.distance < first.distance;
        second = is_first ? first : found;
        first = is_first ? found : first;
    }
    float cosine = dot(first.border.xyz, second.border.xyz);
    bool both = second.index >= 0 && needs_both(cosine);
    uint images = first.index < 0 ? 0u : images_over(first, second, of);
    images |= both ? images_over(second, first, of) << STEPS_BEYOND : 0u;
    bool across = both && first.outwards == vec3(0.0) && second.outwards == vec3(0.0) && needs_corner(cosine);
    images |= across ? 1u << ACROSS_BOTH : 0u;

    uint count = 0u;
    for (uint left = uint(MOST_IMAGES); left > 0u && images != 0u; --left) {
        Depicted image = image_of(of, first, second, uint(findLSB(images)));
        images &= images - 1u;
        bool keeps_side = of.side != 0u;
        uint window_at = at;
        // Where the photon itself is drawn: in so many windows.
        for (int level = 0; level < SLOTS && window_at != NONE; ++level) {
            Placement window = placements[window_at];
            uint drawn_in = window_at, next = window.next;
            Footprint f = footprint_in(window, image.photon, image.middle, image.sweep);
            bool shown =
                in_front(window, image.photon, image.middle, image.sweep) && held_size(window, image.photon, f) >= 1.0;
            if (!keeps_side) drawn_in = choose_level(drawn_in, f, image.photon, image.middle, image.sweep);
            SplatRecord splat = splat_of(image.photon, image.power_w, image.mean, f, image.table, image.band);
            splat.rect = placements[drawn_in].rect;
            vec2 extent = half_extent(splat);
            shown = shown && touches(splat.rect, splat.centre, extent);
            if (SLOTS > 1 && next != NONE) {
                Placement outer = placements[next];
                bool is_fine = is_only_fine(splat.centre, extent, drawn_in, outer, image.photon.position);
                next = shown && is_fine ? NONE : next;
            }
            keep_within_lines(splat, keeps_side ? of.side : 0u, 1.0);
            keeps_side = false;
            if (shown) put(slot + count, splat);
            count += shown ? 1u : 0u;
            window_at = next;
        }
    }
    return count;
}
