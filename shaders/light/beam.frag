// What a beam polygon whose edges move along the spectrum deposits in a texel: the texel's covered area, summed over
// the band.
//
// Where one edge comes over the texel and one leaves it, that is one difference of the running spectrum. Elsewhere
// (corners, polygons as small as a texel) the band is `nodes` equal parts, the same for all texels of a polygon, in
// each of which the polygon stands still where it is in the middle of it: so whatever its shape and size, its texels
// add up to its area.
#include "light/beam_coverage.glsl"
#include "lib/contact.glsl"
layout(binding = 2) uniform usampler2D contact_words;
// Side of what stands for a part of a texel: about its middle, by which it is seen or not.
const float PART_WINDOW = 1.0 / 16.0;

layout(location = 0) out vec4 deposited[TARGETS];

layout(binding = 1) uniform sampler2D curves;

// Parts of a texel's time that are looked at one by one, at most.
const int LOOKED_AT = 16;
// More than so many are not of one length.
const int LOOKED_AT_EVENLY = 4;
// Share of the band over which an edge may pass a texel for the middle of that to be its time.
const float SHORT_RAMP = 0.2;
const float INVERSE_SQRT_3 = 0.57735027;

// Not mix(), which is not exact where both are the same: a spectrum that has ended must not light anything by rounding.
vec4 curve_at(int g, float t) {
    float place = band.x + t * band.y;
    int i = int(place), row = int(band.z) + g;
    vec4 below = texelFetch(curves, ivec2(i, row), 0);
    return below + (place - float(i)) * (texelFetch(curves, ivec2(i + 1, row), 0) - below);
}

float density_at(float t) { return density_nodes.x + t * (density_nodes.y + t * density_nodes.z); }

// Where start + t change is positive in [0, 1].
vec2 positive(float start, float change) {
    float end = start + change;
    float at = start / (start - end);
    return vec2(start > 0.0 ? 0.0 : end > 0.0 ? at : 2.0, end > 0.0 ? 1.0 : start > 0.0 ? at : -1.0);
}

void add_curve(float t, float weight) {
    for (int g = 0; g < TARGETS; ++g) deposited[g] += weight * curve_at(g, t);
}

// Light of an interval in which all of the texel is covered, nothing where it is empty. An edge takes the times `ramps`
// (halves) to come and to leave: the running spectrum is averaged over them (Gauss, two points). The density's slope
// meets the spectrum's.
void add_whole(vec2 interval, vec2 ramps) {
    float middle = 0.5 * (interval.x + interval.y), reach = 0.5 * (interval.y - interval.x);
    float density = density_at(middle) + density_nodes.z * reach * reach * (1.0 / 3.0);
    bool is_even = abs(density_nodes.y) + abs(density_nodes.z) < 0.02 * density_nodes.x;
    float rise = is_even ? 0.0 : (2.0 / 3.0) * reach * (density_nodes.y + 2.0 * middle * density_nodes.z);
    bool is_sudden = max(ramps.x, ramps.y) < 0.01;
    int at_ends = is_sudden ? 2 : 4, count = reach <= 0.0 ? 0 : is_even ? at_ends : at_ends + 1;
    float share = is_sudden ? 1.0 : 0.5;
    for (int i = 0; i < count; ++i) {
        bool is_end = (i & 1) != 0;
        float aside = is_sudden ? 0.0 : (i & 2) != 0 ? INVERSE_SQRT_3 : -INVERSE_SQRT_3;
        float t = i == at_ends ? middle : is_end ? interval.y + aside * ramps.y : interval.x + aside * ramps.x;
        add_curve(t, i == at_ends ? -2.0 * rise : share * (is_end ? rise + density : rise - density));
    }
}

// From a to b, slowly at both ends: where a long time is looked at in few parts, edges come and go within the first and
// the last.
float eased(float s, float a, float b) { return mix(a, b, s * s * (3.0 - 2.0 * s)); }

// Light of two intervals, each looked at in parts. `share` is the function that tells the covered part.
#define ADD_PARTS(intervals, parts, share) \
    { \
        int first_end = parts.x > 0 ? parts.x + 1 : 0, end = first_end + (parts.y > 0 ? parts.y + 1 : 0); \
        float before = 0.0, from = intervals.x; \
        for (int i = 0; i < end; ++i) { \
            bool is_second = i >= first_end; \
            int k = is_second ? i - first_end : i, count = is_second ? parts.y : parts.x; \
            vec2 interval = is_second ? intervals.zw : intervals.xy; \
            from = k == 0 ? interval.x : from; \
            float s = float(k + 1) / float(count); \
            bool is_long = density_nodes.w < 0.0 && count > LOOKED_AT_EVENLY; \
            float to = is_long ? eased(s, interval.x, interval.y) : mix(interval.x, interval.y, s); \
            float t = 0.5 * (from + to); \
            float now = k == count ? 0.0 : share(t) * density_at(t); \
            add_curve(from, before - now); \
            before = now; \
            from = to; \
        } \
    }

// What falls on a texel, or the part of one, about `at`.
void deposit() {
    // The density is linear on the receiver; a texel's area there goes as the inverse cube of 1 / W, and nothing lies
    // beyond the horizon.
    float nearness = 1.0 + dot(perspective, at), nearness2 = nearness * nearness;
    float tilt = nearness < 1e-4 ? 0.0 : max(1.0 + dot(anchor_slope.zw, at), 0.0) / (nearness2 * nearness2);
    if (STILL) {
        bool outside = false;
        for (int e = 0; e < EDGE_COUNT; ++e) {
            vec4 line = EDGE_START(e) + 0.5 * EDGE_CHANGE(e);
            float h = dot(line.xy, at) + line.z;
            float reach = reach_of(line);
            outside = outside || h <= -reach;
            note_crossing(e, h < reach, vec4(line.xy, h, line.w), vec4(0.0));
        }
        crossings = outside ? 0 : crossings;
        float share = half_plane_share(0.5);
        bool is_single = crossings < 2;
        crossings = is_single ? 0 : crossings;
        share = is_single ? share : covered_share(0.5);
        share = outside ? 0.0 : tilt * share;
        for (int g = 0; g < TARGETS; ++g) deposited[g] = share * whole_energy[g];
    } else {
        // When some of the texel may be covered, when all of it is; when all is but for the one edge that bounds that.
        vec2 touched = vec2(0.0, 1.0), whole = vec2(0.0, 1.0), second = vec2(0.0, 1.0);
        for (int e = 0; e < EDGE_COUNT; ++e) {
            vec4 start = EDGE_START(e), change = EDGE_CHANGE(e);
            float h = dot(start.xy, at) + start.z, dh = dot(change.xy, at) + change.z;
            float reach = reach_of(start), widens = reach_of(start + change) - reach;
            vec2 touches = positive(h + reach, dh + widens), covers = positive(h - reach, dh - widens);
            note_crossing(
                e, covers.x > 0.0 || covers.y < 1.0, vec4(start.xy, h, start.w), vec4(change.xy, dh, change.w));
            touched = vec2(max(touched.x, touches.x), min(touched.y, touches.y));
            second = vec2(max(second.x, min(whole.x, covers.x)), min(second.y, max(whole.y, covers.y)));
            whole = vec2(max(whole.x, covers.x), min(whole.y, covers.y));
        }
        bool is_inside = whole.x <= 0.0 && whole.y >= 1.0, is_touched = touched.x < touched.y && !is_inside;
        bool comes = whole.x <= 0.0 || (touched.x > 0.0 && second.x <= touched.x && whole.x - touched.x < SHORT_RAMP);
        bool leaves = whole.y >= 1.0 || (touched.y < 1.0 && second.y >= touched.y && touched.y - whole.y < SHORT_RAMP);
        bool is_short = comes && leaves && whole.x <= whole.y;

        vec4 intervals;
        ivec2 parts;
        bool ever_whole = whole.x < whole.y;
        if (density_nodes.w > 0.0) {
            // Nodes whose middles lie in the intervals.
            float nodes = density_nodes.w;
            vec2 some = clamp(vec2(ceil(touched.x * nodes - 0.5), floor(touched.y * nodes + 0.5)), 0.0, nodes);
            vec2 all = clamp(vec2(ceil(whole.x * nodes - 0.5), floor(whole.y * nodes + 0.5)), 0.0, nodes);
            all = ever_whole && all.x < all.y ? all : some.yy;
            parts = min(ivec2(all.x - some.x, some.y - all.y), ivec2(LOOKED_AT));
            intervals = vec4(some.x, all.xy, some.y) / nodes;
        } else {
            vec2 all = ever_whole ? whole : touched.yy;
            intervals = vec4(touched.x, all.xy, touched.y);
            vec2 lengths = vec2(all.x - touched.x, touched.y - all.y);
            int most = int(-density_nodes.w);
            parts = ever_whole ? 2 + min(ivec2(8.0 * lengths) + 1, ivec2(most - 2))
                               : ivec2(min(int(8.0 * lengths.x) + 5, most), 0);
            parts = ivec2(mix(vec2(0.0), vec2(parts), greaterThan(lengths, vec2(0.0))));
        }
        bool is_slow = is_touched && !is_short;
        for (int g = 0; g < TARGETS; ++g) deposited[g] = is_inside ? whole_energy[g] : vec4(0.0);
        vec2 ramps = vec2(
            whole.x <= 0.0 ? 0.0 : 0.5 * (touched.x + whole.x), whole.y >= 1.0 ? 1.0 : 0.5 * (touched.y + whole.y));
        vec2 halves = is_short ? 0.5 * max(vec2(whole.x - touched.x, touched.y - whole.y), 0.0) : vec2(0.0);
        add_whole(!is_touched ? vec2(0.0) : is_short ? ramps : intervals.yz, halves);
        // Of one edge alone the share costs little; a loop that no texel needs costs little as well.
        bool is_single = crossings < 2;
        ivec2 single = is_slow && is_single ? parts : ivec2(0), several = is_slow && !is_single ? parts : ivec2(0);
        crossings = is_single ? 0 : crossings;
        ADD_PARTS(intervals, single, half_plane_share)
        ADD_PARTS(intervals, several, covered_share)
        // Differences of the running spectrum are rounded: what divides by the maps must never meet a negative sum.
        for (int g = 0; g < TARGETS; ++g) deposited[g] = max(tilt * deposited[g], 0.0);
    }
}

void main() {
    at = gl_FragCoord.xy - anchor_slope.xy;
    if (CONTACT_LINES) {
        // A texel in which a line of contact lies keeps what falls on those parts that are seen.
        uint word = texelFetch(contact_words, ivec2(gl_FragCoord.xy), 0).x, seen = word & 0xffffu;
        bool is_cut = is_contact(word) && seen != 0u;
        vec2 middle = at;
        vec4 sum[TARGETS];
        for (int g = 0; g < TARGETS; ++g) sum[g] = vec4(0.0);
        window_less = is_cut ? 1.0 - PART_WINDOW * PART_WINDOW : 0.0;
        uint left = is_cut ? seen : 1u;
        float weight = is_cut ? 1.0 / float(bitCount(seen)) : 1.0;
        while (left != 0u) {
            at = is_cut ? middle + part_place(uint(findLSB(left))) : middle;
            left &= left - 1u;
            begin_place();
            deposit();
            for (int g = 0; g < TARGETS; ++g) sum[g] += weight * deposited[g];
        }
        for (int g = 0; g < TARGETS; ++g) deposited[g] = sum[g];
    } else {
        begin_place();
        deposit();
    }
}
