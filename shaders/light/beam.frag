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

// Light of the interval, all of the texel covered; the density's slope meets the spectrum's.
void add_whole(vec2 interval, float tilt) {
    float middle = 0.5 * (interval.x + interval.y), reach = 0.5 * (interval.y - interval.x);
    float density = tilt * (density_at(middle) + density_nodes.z * reach * reach * (1.0 / 3.0));
    float rise = tilt * (density_nodes.y + 2.0 * middle * density_nodes.z) * reach;
    bool is_even = abs(density_nodes.y) + abs(density_nodes.z) < 0.02 * density_nodes.x;
    for (int g = 0; g < TARGETS; ++g) {
        vec4 below = curve_at(g, interval.x), above = curve_at(g, interval.y);
        deposited[g] += density * (above - below);
        WHEN (!is_even) deposited[g] += rise * (4.0 / 3.0) * (0.5 * (below + above) - curve_at(g, middle));
    }
}

void add_nodes(vec2 touched, vec2 whole, float tilt) {
    float nodes = density_nodes.w, per_node = 1.0 / nodes;
    // Parts whose middles lie in the intervals.
    int first = max(int(ceil(touched.x * nodes - 0.5)), 0);
    int last = min(int(floor(touched.y * nodes - 0.5)), int(nodes) - 1);
    int whole_first = max(int(ceil(whole.x * nodes - 0.5)), 0);
    int whole_last = whole.x <= whole.y ? min(int(floor(whole.y * nodes - 0.5)), int(nodes) - 1) : -1;
    if (whole_last < whole_first) {
        whole_first = last + 1;
        whole_last = last;
    } else {
        add_whole(vec2(float(whole_first), float(whole_last + 1)) * per_node, tilt);
    }
    for (int side = 0; side < 2; ++side) {
        int row_first = side == 0 ? first : whole_last + 1, row_end = side == 0 ? min(whole_first, last + 1) : last + 1;
        int row = row_end - row_first;
        if (row <= 0) continue;
        int step = row > LOOKED_AT ? (row - LOOKED_AT + LOOKED_AT - 2 * AT_ENDS - 1) / (LOOKED_AT - 2 * AT_ENDS) : 1;
        vec4 below[TARGETS];
        for (int g = 0; g < TARGETS; ++g) below[g] = curve_at(g, float(row_first) * per_node);
        for (int k = row_first; k < row_end;) {
            int end = k + 1;
            if (k - row_first >= AT_ENDS && row_end - k > AT_ENDS) end = min(k + step, row_end - AT_ENDS);
            float t = 0.5 * float(k + end) * per_node;
            float share = covered_share(t) * tilt * density_at(t);
            for (int g = 0; g < TARGETS; ++g) {
                vec4 above = curve_at(g, float(end) * per_node);
                deposited[g] += share * (above - below[g]);
                below[g] = above;
            }
            k = end;
        }
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
    bool is_inside = whole.x <= 0.0 && whole.y >= 1.0;
    for (int g = 0; g < TARGETS; ++g) deposited[g] = is_inside ? tilt * whole_energy[g] : vec4(0.0);
    WHEN (!is_inside && touched.x < touched.y) {
        bool comes = whole.x <= 0.0 || (touched.x > 0.0 && second.x <= touched.x && whole.x - touched.x < SHORT_RAMP);
        bool leaves = whole.y >= 1.0 || (touched.y < 1.0 && second.y >= touched.y && touched.y - whole.y < SHORT_RAMP);
        bool is_short = comes && leaves && whole.x <= whole.y;
        WHEN (is_short) {
            vec2 interval = vec2(whole.x <= 0.0 ? 0.0 : 0.5 * (touched.x + whole.x), whole.y >= 1.0 ? 1.0 : 0.5 * (touched.y + whole.y));
            add_whole(interval, tilt);
        }
        WHEN (!is_short) add_nodes(touched, whole, tilt);
    }
#endif
}
