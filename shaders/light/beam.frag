// What a beam polygon whose edges move along the spectrum deposits in a texel: the texel's covered area, summed over the band.
//
// Where one edge comes over the texel and one leaves it, that is one difference of the running spectrum. Elsewhere (corners, polygons as small as a texel) the
// band is `nodes` equal parts, the same for all texels of a polygon, in each of which the polygon stands still where it is in the middle of it: so whatever its
// shape and size, its texels add up to its area.
#include "light/beam_coverage.glsl"

layout(location = 0) out vec4 deposited[TARGETS];

#ifndef STILL
layout(binding = 1) uniform sampler2D curves;

// Parts of the band in a row that are looked at one by one; of longer rows only those at either end are.
const int LOOKED_AT = 10;
const int AT_ENDS = 3;
// Share of the band over which an edge may pass a texel for the middle of that to be its time.
const float SHORT_RAMP = 0.2;

vec4 curve_at(int g, float t) {
    float place = band.x + t * band.y;
    int i = int(place), row = int(band.z) + g;
    return mix(texelFetch(curves, ivec2(i, row), 0), texelFetch(curves, ivec2(i + 1, row), 0), place - float(i));
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

// Light of an interval in which all of the texel is covered; nothing where it is empty. The density's slope meets the spectrum's.
void add_whole(vec2 interval) {
    float middle = 0.5 * (interval.x + interval.y), reach = 0.5 * (interval.y - interval.x);
    float density = density_at(middle) + density_nodes.z * reach * reach * (1.0 / 3.0);
    float rise = (2.0 / 3.0) * reach * (density_nodes.y + 2.0 * middle * density_nodes.z);
    bool is_even = abs(density_nodes.y) + abs(density_nodes.z) < 0.02 * density_nodes.x;
    int count = reach <= 0.0 ? 0 : is_even ? 2 : 3;
    for (int i = 0; i < count; ++i) {
        float t = i == 0 ? interval.x : i == 1 ? interval.y : middle;
        add_curve(t, i == 0 ? rise - density : i == 1 ? rise + density : -2.0 * rise);
    }
}

// Light of the parts k, first <= k <= last, but for those from rows.x to rows.y.
void add_nodes(int first, int last, ivec2 rows) {
    float per_node = 1.0 / density_nodes.w, before = 0.0;
    for (int k = first; k <= last + 1;) {
        int row_first = k < rows.x ? first : rows.y + 1, row_end = k < rows.x ? min(rows.x, last + 1) : last + 1;
        int row = row_end - row_first;
        int middle = min(k + (row - 2 * AT_ENDS + LOOKED_AT - 2 * AT_ENDS - 1) / (LOOKED_AT - 2 * AT_ENDS), row_end - AT_ENDS);
        int end = row > LOOKED_AT && k - row_first >= AT_ENDS && row_end - k > AT_ENDS ? middle : k + 1;
        bool is_left_out = k > last || (k >= rows.x && k <= rows.y);
        float t = 0.5 * float(k + end) * per_node;
        float now = is_left_out ? 0.0 : covered_share(t) * density_at(t);
        add_curve(float(k) * per_node, before - now);
        before = now;
        k = k == rows.x && rows.y >= k ? rows.y + 1 : end;
    }
}
#endif

void main() {
    at = gl_FragCoord.xy - anchor_slope.xy;
    float tilt = max(1.0 + dot(anchor_slope.zw, at), 0.0);
#ifdef STILL
    float share = tilt * covered_share(0.5);
    for (int g = 0; g < TARGETS; ++g) deposited[g] = share * whole_energy[g];
#else
    // When some of the texel may be covered, when all of it is; when all is but for the one edge that bounds that.
    vec2 touched = vec2(0.0, 1.0), whole = vec2(0.0, 1.0), second = vec2(0.0, 1.0);
    for (int e = 0; e < EDGE_COUNT; ++e) {
        vec4 start = EDGE_START(e), change = EDGE_CHANGE(e);
        float h = dot(start.xy, at) + start.z, dh = dot(change.xy, at) + change.z;
        vec2 touches = positive(h + start.w, dh + change.w), covers = positive(h - start.w, dh - change.w);
        touched = vec2(max(touched.x, touches.x), min(touched.y, touches.y));
        second = vec2(max(second.x, min(whole.x, covers.x)), min(second.y, max(whole.y, covers.y)));
        whole = vec2(max(whole.x, covers.x), min(whole.y, covers.y));
    }
    bool is_inside = whole.x <= 0.0 && whole.y >= 1.0, is_touched = touched.x < touched.y && !is_inside;
    bool comes = whole.x <= 0.0 || (touched.x > 0.0 && second.x <= touched.x && whole.x - touched.x < SHORT_RAMP);
    bool leaves = whole.y >= 1.0 || (touched.y < 1.0 && second.y >= touched.y && touched.y - whole.y < SHORT_RAMP);
    bool is_short = comes && leaves && whole.x <= whole.y;

    // Parts whose middles lie in the intervals.
    float nodes = density_nodes.w;
    int first = max(int(ceil(touched.x * nodes - 0.5)), 0), last = min(int(floor(touched.y * nodes - 0.5)), int(nodes) - 1);
    ivec2 rows = ivec2(max(int(ceil(whole.x * nodes - 0.5)), 0), min(int(floor(whole.y * nodes - 0.5)), int(nodes) - 1));
    rows = whole.x <= whole.y && rows.x <= rows.y ? rows : ivec2(last + 1, last);
    vec2 ramps = vec2(whole.x <= 0.0 ? 0.0 : 0.5 * (touched.x + whole.x), whole.y >= 1.0 ? 1.0 : 0.5 * (touched.y + whole.y));

    for (int g = 0; g < TARGETS; ++g) deposited[g] = is_inside ? whole_energy[g] : vec4(0.0);
    add_whole(!is_touched ? vec2(0.0) : is_short ? ramps : vec2(rows.x, rows.y + 1) / nodes);
    add_nodes(first, is_touched && !is_short ? last : first - 2, rows);
    for (int g = 0; g < TARGETS; ++g) deposited[g] *= tilt;
#endif
}
