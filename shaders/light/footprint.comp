// One thread a photon: its Gaussian footprint and spectral sweep, in texels of the map it lands on.
// The sweep follows the chord between the landing points of the band's two ends (exact where one material
// disperses: the spectral coordinate is then affine in its index). Elek et al. 2014; Schjoth et al. 2007.
#include "lib/finite.glsl"
#include "lib/gaussian.glsl"
#include "lib/lattice.glsl"
#include "lib/placement.glsl"
#include "lib/fan.glsl"
#include "lib/swept.glsl"
#include "lib/edge.glsl"

layout(local_size_x = WORKGROUP) in;

#include "light/footprint_parameters.glsl"
#include "light/splat_pieces.glsl"
layout(std430, binding = 0) readonly buffer Photons { uvec4 photon_texels[]; };
layout(std430, binding = 1) writeonly buffer Splats { uvec4 splat_texels[]; };
layout(std430, binding = 2) readonly buffer Placements { Placement placements[]; };
layout(std430, binding = 3) readonly buffer Receivers { Receiver receivers[]; };
layout(std430, binding = 4) readonly buffer VarTables { float var_table[]; };
layout(std430, binding = 5) readonly buffer Bands {
    vec4 table_bands[];
};  // x_lo, x_hi, mean place of the light in it (0..1), W; then W below x, by light and class
layout(std430, binding = 6) buffer Sums {
#if IN_PIECES
    uint kind_words[KIND_WORDS * KINDS];  // splat_pieces.glsl
#endif
    vec4 sums[];
};  // of the photons of this thread: W with the centre in no window, W drawn as one texel, how many so, W of all

layout(std430, binding = 9) readonly buffer GainBoxes { GainBox gain_boxes[]; };
layout(std430, binding = 10) readonly buffer Gains { float gains[]; };

struct TracedBand {
    vec4 range;  // the band's ends as traced, the ends of its light's spectrum in the coordinate that is shown
    vec4 side;  // 1 for the first band, 1 for the last one
};
layout(std430, binding = 11) readonly buffer TracedBands { TracedBand traced_bands[]; };

#include "lib/contact.glsl"
#define PLACED_PICTURE 2u
layout(binding = 1) uniform usampler2D contact_words;

#include "lib/border.glsl"
layout(binding = 2) uniform sampler2D borders;

#define RECEIVER_CHARTS 1u

const float TEXEL_VARIANCE = 1.0 / 12.0;
// Standard deviations. Below the first two a splat is smaller than what a map can show: SMALL.
const float SMALL_STD = 0.4;
const float SMALL_SWEEP = 0.75;
const float ACROSS_FLOOR = 0.1;
// Sampling at texel centres needs this much blur where no box average does the work.
const float SAMPLED_VARIANCE = 0.12;
const float THIN_VARIANCE = 0.15;
const float CUT = 3.0;
// A footprint fans out where its width changes by more than the first over a standard deviation of its length; by the
// second at most.
const float LEAST_FAN = 0.015;
// Texels: the texel's own blur knows no perspective, and of shorter footprints it is most of what is drawn.
const float LEAST_FANNED = 0.75;
const float MOST_FAN = 3.0;
// Splats of a texel's standard deviation at least go to a map with texels twice as wide.
const float BROAD_VARIANCE = 1.0;
const int WIDER_LEVELS = 6;
// `area_of_all`, pixels², from which on whole pixels of the picture show a splat.
const float WHOLE_PIXELS = 0.3;
// Three texels of a wider level that is chosen for a splat, over its larger half extent, at most.
const float LEVEL_REACH = 2.5;
// What texels twice as wide add to the variance of what is drawn, in their own area: the bilinear interpolation on the
// way back (1/6) and their box (1/12) in place of the narrow texels' (1/48).
const float LEVEL_BLUR = 11.0 / 48.0;
const float MIN_SIGMA_TO_SWEEP = 1.0 / 256.0;
const float MAX_SIGMA_TO_SWEEP = 32.0;

struct Footprint {
    vec2 centre;  // texels, at the middle of the chord
    vec2 axis_s;
    vec2 axis_t;
    vec2 chord;
    float per_spacing;  // the axes over the lattice's own steps
    vec2 fan;  // change of W (lib/fan.glsl) per texel, along the longer axis
    float taken;  // variance that wide texels will add, and that is not drawn, texels²
};

float spectral_variable(uint group, float x) {
    float at = clamp(x, 0.0, 1.0) * float(var_samples - 1u);
    uint i = min(uint(at), var_samples - 2u);
    uint base = group * var_samples + i;
    return mix(var_table[base], var_table[base + 1u], at - float(i));
}

// The brush's gain of dispersion at a place on a receiver: trilinear between voxel centres, 1 outside the box.
float local_gain(uint receiver, vec3 position) {
    GainBox box = gain_boxes[receiver];
    if (box.voxels.x == 0u) return 1.0;
    vec4 at = vec4(position, 1.0);
    vec3 voxel = vec3(dot(box.row_x, at), dot(box.row_y, at), dot(box.row_z, at));
    uvec3 count = box.voxels.xyz;
    vec3 last = vec3(count) - 1.0;
    if (any(lessThan(voxel, vec3(-0.5))) || any(greaterThan(voxel, last + 0.5))) return 1.0;
    voxel = clamp(voxel, vec3(0.0), last);
    uvec3 low = uvec3(voxel), high = min(low + 1u, count - 1u);
    vec3 f = voxel - vec3(low);
    float gain = 0.0;
    for (uint corner = 0u; corner < 8u; ++corner) {
        bvec3 far = bvec3((corner & 1u) != 0u, (corner & 2u) != 0u, (corner & 4u) != 0u);
        uvec3 c = uvec3(far.x ? high.x : low.x, far.y ? high.y : low.y, far.z ? high.z : low.z);
        vec3 w = vec3(far.x ? f.x : 1.0 - f.x, far.y ? f.y : 1.0 - f.y, far.z ? f.z : 1.0 - f.z);
        gain += w.x * w.y * w.z * gains[box.voxels.w + (c.z * count.y + c.y) * count.x + c.x];
    }
    return gain;
}

// The number of the photon's lattice, 0 where only every `stride`-th photon is splatted: these form no lattice.
uint lattice_of(PhotonRecord photon) { return stride == 1u ? photon.flags >> LATTICE_BIT : 0u; }

#include "light/splat_power.glsl"
#include "light/splat_shapes.glsl"

// Share of the smoothing that a footprint needs. What ripple it leaves with less is taken off (`flatten_lattice`), the
// better the less of the light at a place is of many wavelengths, each with waves of its own: none need be left where
// the spectrum stays within a tenth of a spacing, most is beyond a half. Lattices finer than texels are not flattened.
float needed_smoothing(PhotonRecord photon, vec2 step_s, vec2 step_t, vec2 chord) {
    float area = step_s.x * step_t.y - step_s.y * step_t.x;
    if (narrowed >= 1.0 || lattice_of(photon) == 0u || abs(area) < 1e-6) return 1.0;
    vec2 spacings = vec2(chord.x * step_t.y - chord.y * step_t.x, step_s.x * chord.y - step_s.y * chord.x) / area;
    float parted = 2.5 * length(spacings) - 0.25, fine = 4.0 - 4.0 * sqrt(abs(area));
    return mix(narrowed, 1.0, clamp(max(parted, fine), 0.0, 1.0));
}

// A footprint that widens along its longer axis, by the last flight's perspective and by that of the picture's pixels.
vec2 fan_in(Placement place, PhotonRecord photon, float w, vec2 step_s, vec2 step_t) {
    vec2 axis = longest_axis(vec3(dot(step_s, step_s), dot(step_s, step_t), dot(step_t, step_t)));
    vec2 change = unpackHalf2x16(photon.fan)
        + vec2(dot(place.row_w.xyz, photon.dposition_ds), dot(place.row_w.xyz, photon.dposition_dt)) / w;
    vec2 longest = axis.x * step_s + axis.y * step_t;
    return dot(change, axis) / max(dot(longest, longest), 1e-20) * longest;
}

Footprint footprint_in(Placement place, PhotonRecord photon, vec3 sweep_middle, vec3 sweep) {
    vec3 at = homogeneous_texel(place, photon.position + sweep_middle);
    vec2 step_s = texels_along(place, at, photon.dposition_ds), step_t = texels_along(place, at, photon.dposition_dt);
    Footprint f;
    f.centre = at.xy / at.z;
    f.chord = texels_along(place, at, sweep);
    f.per_spacing = smoothing * needed_smoothing(photon, step_s, step_t, f.chord);
    f.axis_s = f.per_spacing * step_s;
    f.axis_t = f.per_spacing * step_t;
    f.fan = fan_in(place, photon, at.z, step_s, step_t);
    f.taken = 0.0;
    return f;
}

// Whether all of the sweep is in front of the camera that a map is seen by: where it is not, it lies outside of it.
bool in_front(Placement place, PhotonRecord photon, vec3 sweep_middle, vec3 sweep) {
    if (place.row_w.xyz == vec3(0.0)) return true;
    vec3 from = photon.position + sweep_middle - 0.5 * sweep, to = from + sweep;
    return min(homogeneous_texel(place, from).z, homogeneous_texel(place, to).z) > 0.0;
}

// A splat broad in every direction is as well drawn in texels twice as wide, for a quarter of the
// fragments; the maps are put together again when they are read (resolve.comp, bilinearly). What only is long shows no
// more than whole pixels of the picture do.
// Returns the index of the placement with these texels.
uint choose_level(uint at, inout Footprint f, PhotonRecord photon, vec3 middle, vec3 sweep) {
    Placement place = placements[at];
    if (place.kind == PLACED_PICTURE) {
        Placement pixels = placements[place.blurred];
        Footprint g = footprint_in(pixels, photon, middle, sweep);
        if (area_of_all(g) < WHOLE_PIXELS) return at;
        f = g;
        at = place.blurred;
        place = pixels;
    }
    for (int step = 0; step < WIDER_LEVELS; ++step) {
        if (place.blurred != NONE && thin_variance(f) > BROAD_VARIANCE) {
            float taken = 0.25 * f.taken + LEVEL_BLUR;
            at = place.blurred;
            place = placements[at];
            f = footprint_in(place, photon, middle, sweep);
            f.taken = taken;
        }
    }
    return at;
}

SplatRecord splat_of(PhotonRecord photon, float power_w, float mean, Footprint f, uint table, vec4 band) {
    vec2 d = vec2(dot(f.axis_s, f.axis_s), dot(f.axis_t, f.axis_t));
    float cross_st = dot(f.axis_s, f.axis_t);
    float major = 0.5 * (d.x + d.y) + sqrt(0.25 * (d.x - d.y) * (d.x - d.y) + cross_st * cross_st);
    SplatRecord splat;
    if (major < SMALL_STD * SMALL_STD && dot(f.chord, f.chord) < SMALL_SWEEP * SMALL_SWEEP) {
        splat = small_splat(photon, power_w, mean, f, band);
    } else {
        splat = swept_splat(photon, power_w, mean, f, table / bands, band);
    }
    splat.layer = table * uint(TARGETS);
    if (HERO) carry_companions(splat, photon);
    return splat;
}

bool touches(vec4 rect, vec2 centre, vec2 extent) {
    return all(greaterThan(centre + extent, rect.xy)) && all(lessThan(centre - extent, rect.zw));
}

bool contains(vec4 rect, vec2 centre, float margin) {
    return all(greaterThanEqual(centre, rect.xy + margin)) && all(lessThan(centre, rect.zw - margin));
}

// What of a footprint's size can be drawn: beyond `extent_limit` texels no digits are left to tell how thin it is. 0:
// it is a numerical accident.
float held_size(Placement place, PhotonRecord photon, Footprint f) {
    vec3 anchor = homogeneous_texel(place, photon.position);
    vec2 away = f.centre - anchor.xy / anchor.z;
    vec2 largest = max(max(abs(f.axis_s), abs(f.axis_t)), max(abs(f.chord), abs(away)));
    bool is_number = is_within2(f.axis_s, FAR_TOO_LARGE) && is_within2(f.axis_t, FAR_TOO_LARGE)
        && is_within2(f.chord, FAR_TOO_LARGE) && is_within2(away, FAR_TOO_LARGE);
    return is_number ? min(1.0, extent_limit / max(max(largest.x, largest.y), 1e-20)) : 0.0;
}

void shrink(inout PhotonRecord photon, inout vec3 middle, inout vec3 sweep, float share) {
    bool is_left = share > 0.0;
    photon.dposition_ds = is_left ? share * photon.dposition_ds : vec3(0.0);
    photon.dposition_dt = is_left ? share * photon.dposition_dt : vec3(0.0);
    middle = is_left ? share * middle : vec3(0.0);
    sweep = is_left ? share * sweep : vec3(0.0);
}

// Which of the steps whose power `step_w` holds have their middles in a window, a bit each.
uint steps_within(vec4 rect, Footprint f, PhotonRecord photon) {
    uint within = 0u;
    for (uint k = 0u; k < 2u * POWER_STEPS; ++k)
        within |=
            contains(rect, f.centre + step_place(k, 0.5, anchor_in_band(photon) - 0.5) * f.chord, 0.0) ? 1u << k : 0u;
    return within;
}

// Share of a photon's power in those steps.
float share_within(PhotonRecord photon, uint within) {
    vec2 power = vec2(0.0);
    if (!POINT_SPECTRUM) {
        for (uint k = 0u; k < 2u * POWER_STEPS && photon.x_hi > photon.x_lo; ++k) {
            float to_anchor = (float(k % POWER_STEPS) + 0.5) / float(POWER_STEPS);
            float here = step_w[k]
                * (k < POWER_STEPS ? mix(photon.throughput.x, photon.throughput.y, to_anchor)
                                   : mix(photon.throughput.y, photon.throughput.z, to_anchor));
            power += vec2((within >> k & 1u) != 0u ? here : 0.0, here);
        }
    }
    return power.y > 0.0 ? power.x / power.y : float(bitCount(within)) / float(2u * POWER_STEPS);
}

// Whether a splat of this half extent, drawn by the placement `at`, lies so deep inside a fine window that nobody reads
// it in the coarse one `outer`: that is read up to the fine one's border, plus what a bilinear lookup there reaches.
bool is_only_fine(vec2 centre, vec2 extent, uint at, Placement outer, vec3 position) {
    Placement place = placements[at];
    vec3 in_outer = homogeneous_texel(outer, position), in_fine = homogeneous_texel(place, position);
    extent += 3.0 * texels_per_length(place, in_fine) / texels_per_length(outer, in_outer);
    return all(greaterThan(centre - extent, place.rect.xy)) && all(lessThan(centre + extent, place.rect.zw));
}

#include "light/splat_sides.glsl"

#if IN_PIECES
shared uint splats_of[KINDS];
shared uint pieces_of[KINDS];
#endif

#define LOAD_PHOTON(at) photon_texels[at]
#define STORE_SPLAT(at, texel) splat_texels[at] = texel

void put(uint slot, SplatRecord splat) {
#if IN_PIECES
    if (splat.kind != 0u) {
        uint bits = pieces_to_add(splat);
        atomicAdd(splats_of[splat.kind - 1u], 1u);
        atomicAdd(pieces_of[splat.kind - 1u], bits >> PIECES_BIT);
        splat.kind |= bits;
    }
#endif
    SplatRecord_TO(STORE_SPLAT, slot * uint(SplatRecord_TEXELS), splat)
}

#include "light/footprint_images.glsl"

void make_splats(uint i) {
    uint own = gl_GlobalInvocationID.x;
    uint record = (first_photon + i * stride) * uint(PhotonRecord_TEXELS);
    PhotonRecord photon = PhotonRecord_FROM(LOAD_PHOTON, record);
    Receiver receiver = receivers[photon.receiver];
    uint at = receiver.placement;
    if (CHARTS) at += receiver.kind == RECEIVER_CHARTS ? photon.triangle - receiver.first_triangle : 0u;
    Placement place = placements[at];

    uint light = photon.light_and_source & 255u;
#ifdef TINT_LEVELS
    light = light * uint(TINT_LEVELS) + bitfieldExtract(photon.flags, TINT_BIT, LATTICE_BIT - TINT_BIT);
#endif
    uint band = (photon.light_and_source >> 8u) & 255u;
    uint table = (light * classes + receiver.reflectance_class) * bands + band;
    vec4 table_band = table_bands[table];

    vec3 to_lo = vec3(0.0);
    vec3 to_hi = vec3(0.0);
#if GROUPS > 0
#if GROUPS > 3
#define ALL_GROUPS(what) what(0) what(1) what(2) what(3)
#elif GROUPS > 2
#define ALL_GROUPS(what) what(0) what(1) what(2)
#elif GROUPS > 1
#define ALL_GROUPS(what) what(0) what(1)
#else
#define ALL_GROUPS(what) what(0)
#endif
    // The path belongs to the glass it was traced through.
    float x_traced = photon.x_anchor;
#if REINDEXED
    // What a path is depends on the one index only: its interval of that stays, and which wavelengths have it now
    // depends on the glass that is shown and on the local gain. y is affine in the index.
    float v_traced = spectral_variable(traced_row, x_traced);
    vec2 v_ends = vec2(spectral_variable(traced_row, photon.x_lo), spectral_variable(traced_row, photon.x_hi));
    float grown = 1.0;
#if LOCAL_GAIN
    vec3 to_reference = photon.dposition_dvar0.xyz * ((x_reference - y_offset) / y_scale - v_traced);
    grown = max(local_gain(photon.receiver, photon.position + to_reference), 1e-3);
#endif
    TracedBand traced = traced_bands[table];
    bool is_line = photon.x_hi <= photon.x_lo;
    bvec2 whole = lessThan(abs(vec2(photon.x_lo, photon.x_hi) - traced.range.xy), vec2(1e-6));
    vec2 y = x_reference + (y_offset + y_scale * v_ends - x_reference) / grown;
    vec2 y_in = clamp(y, traced.range.z, traced.range.w);
    // The outermost bands reach to the ends of the light's spectrum, the others to their neighbours.
    if (is_line || (whole.x && traced.side.x > 0.0 && y.y > traced.range.z)) y_in.x = traced.range.z;
    if (is_line || (whole.y && traced.side.y > 0.0 && y.x < traced.range.w)) y_in.y = traced.range.w;
    bool carries = is_line || y_in.y > y_in.x;
    if (grown == 1.0 && carries) {
        // To the last digit those of the table, or the photon would pass for a cut one.
        y_in = mix(y_in, table_band.xy, whole);
    }
    vec2 v_path = (x_reference + grown * (y_in - x_reference) - y_offset) / y_scale;
    to_lo = photon.dposition_dvar0.xyz * (v_path.x - v_traced);
    to_hi = photon.dposition_dvar0.xyz * (v_path.y - v_traced);
    photon.x_lo = y_in.x;
    photon.x_hi = y_in.y;
    float y_anchor = x_reference + (y_offset + y_scale * v_traced - x_reference) / grown;
    // Throughput depends on the index alone, straight on both sides of the anchor.
    vec2 reach = (y_in - y_anchor) / mix(y - y_anchor, vec2(1.0), lessThan(abs(y - y_anchor), vec2(1e-6)));
    photon.throughput.xz = max(mix(photon.throughput.yy, photon.throughput.xz, reach), 0.0);
    photon.x_anchor = clamp(y_anchor, y_in.x, y_in.y);
#else
#if LOCAL_GAIN
    // Displacements grow about where the light of the reference wavelength lands, the same place for all bands of a
    // path.
    vec3 to_reference = vec3(0.0);
#define ADD_REFERENCE(g) \
    to_reference += photon.dposition_dvar##g.xyz \
        * (spectral_variable(uint(g), x_reference) - spectral_variable(traced_row + uint(g), x_traced));
    ALL_GROUPS(ADD_REFERENCE)
#endif
#define ADD_GROUP(g) \
    { \
        float anchor = spectral_variable(traced_row + uint(g), x_traced); \
        to_lo += photon.dposition_dvar##g.xyz * (spectral_variable(uint(g), photon.x_lo) - anchor); \
        to_hi += photon.dposition_dvar##g.xyz * (spectral_variable(uint(g), photon.x_hi) - anchor); \
    }
    ALL_GROUPS(ADD_GROUP)
#if LOCAL_GAIN
    float gain = local_gain(photon.receiver, photon.position + to_reference);
    to_lo = mix(to_reference, to_lo, gain);
    to_hi = mix(to_reference, to_hi, gain);
#endif
#endif
#endif
    float power_w = photon_power(photon, table / bands, table_band);
    if (REINDEXED) power_w = carries ? power_w : 0.0;
    sums[own].w += power_w;
    float mean = mean_throughput(photon, power_w, table_band);
    vec3 middle = 0.5 * (to_lo + to_hi);
    vec3 sweep = to_hi - to_lo;
    Footprint f = footprint_in(place, photon, middle, sweep);
    bool shown = in_front(place, photon, middle, sweep);
    float held = shown ? held_size(place, photon, f) : 1.0;
    if ((held < 1.0 || !shown) && place.next != NONE) {
        // Close to the camera, texels of its pixels are as small as one likes: the coarse window tells.
        shown = false;
        Placement coarse = placements[place.next];
        held = held_size(coarse, photon, footprint_in(coarse, photon, middle, sweep));
    }
    held = (photon.flags & FLAG_FOOTPRINT_DROPPED) != 0u ? 0.0 : held;
    if (held < 1.0) {
        shrink(photon, middle, sweep, held);
        f = footprint_in(place, photon, middle, sweep);
        sums[own].yz += vec2(power_w, 1.0);
    }

    uint within = shown ? steps_within(place.rect, f, photon) : 0u;
    float kept = 1.0, lost = 0.0, thin = thin_variance(f);
    uint side = 0u;
    if (CONTACT_LINES) {
        if (shown) side = side_of_contact(place, f, photon.photon_id, kept, lost);
        sums[own].x += lost * power_w;
    }
    uint drawn_in = at;
    if (side == 0u) drawn_in = choose_level(at, f, photon, middle, sweep);
    // Written at once, and held no longer: a GPU has room for few words an invocation.
    SplatRecord fine = splat_of(photon, power_w, mean, f, table, table_band);
    fine.rect = placements[drawn_in].rect;
    vec2 fine_centre = fine.centre, fine_extent = half_extent(fine);
    bool drawn = shown && touches(fine.rect, fine_centre, fine_extent);
    if (REINDEXED) drawn = drawn && carries;
    if (!drawn) {
        fine.kind = 0u;
    }
    keep_within_lines(fine, side, kept);
    uint slot = i * uint(SLOTS + IMAGE_SLOTS);
    put(slot, fine);
    if (BORDER_IMAGES) {
        // Behind the photon's own splats, so many of them.
        Depicted depicted = Depicted(photon, middle, sweep, power_w, mean, table, table_band, side, thin);
        bool has_images = true;
        if (REINDEXED) has_images = carries;
        splat_texels[slot * uint(SplatRecord_TEXELS)].y =
            has_images ? put_images(depicted, at, slot + uint(SLOTS)) : 0u;
    }

    if (SLOTS > 1) {
        // In the coarser windows round it, as far as what is drawn reaches over a finer one's border.
        vec2 centre = fine_centre, extent = fine_extent;
        int level = 1;
        uint next = placements[at].next;
        for (; level < SLOTS && next != NONE; ++level) {
            Placement outer = placements[next];
            if (shown
                && is_only_fine(
                    centre, extent + LEVEL_REACH * max(extent.x, extent.y), drawn_in, outer, photon.position))
                break;
            // Far from the camera, texels of its pixels are the larger ones.
            Footprint g = footprint_in(outer, photon, middle, sweep);
            float held_there = held_size(outer, photon, g);
            if (held_there < 1.0) {
                shrink(photon, middle, sweep, held_there);
                g = footprint_in(outer, photon, middle, sweep);
            }
            within |= steps_within(outer.rect, g, photon);
            uint wide = choose_level(next, g, photon, middle, sweep);
            Placement widest = placements[wide];
            if (shown && is_only_fine(centre, extent, drawn_in, widest, photon.position)) break;
            SplatRecord coarse = splat_of(photon, power_w, mean, g, table, table_band);
            coarse.rect = widest.rect;
            centre = coarse.centre;
            extent = half_extent(coarse);
            if (!touches(coarse.rect, centre, extent)) coarse.kind = 0u;
            if (REINDEXED && !carries) coarse.kind = 0u;
            keep_within_lines(coarse, 0u, 1.0);
            put(slot + uint(level), coarse);
            shown = true;
            drawn_in = wide;
            next = outer.next;
        }
        for (; level < SLOTS; ++level) splat_texels[(slot + uint(level)) * uint(SplatRecord_TEXELS)] = uvec4(0u);
    }

    sums[own].x += power_w * (1.0 - share_within(photon, within));
}

void main() {
    uint me = gl_LocalInvocationID.x, count = photons_there();
#if IN_PIECES
    if (me < KINDS) splats_of[me] = pieces_of[me] = 0u;
    barrier();
#endif
    for (uint i = gl_GlobalInvocationID.x; i < count; i += gl_NumWorkGroups.x * uint(WORKGROUP)) make_splats(i);
#if IN_PIECES
    barrier();
    if (me < KINDS) {
        atomicAdd(kind_words[KIND_WORDS * me + SPLATS_AT], splats_of[me]);
        atomicAdd(kind_words[KIND_WORDS * me + PIECES_AT], pieces_of[me]);
    }
#endif
}
