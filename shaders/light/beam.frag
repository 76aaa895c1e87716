// What a beam polygon whose edges move along the spectrum deposits in a texel: the texel's covered area, summed over the band.
//
// The band is `nodes` equal parts, the same for all texels of a polygon, in each of which the polygon stands still where it is in the middle of it. So whatever
// the polygon's shape and size, its texels add up to its area. Parts in which the texel is all inside are one difference of the running spectrum.
layout(std430, binding = 1) readonly buffer Beams { BeamRecord beams[]; };
layout(std430, binding = 2) readonly buffer Edges { BeamEdge edges[]; };
layout(std430, binding = 3) readonly buffer Curves { vec4 curve[]; };

flat in uint polygon;
layout(location = 0) out vec4 deposited[TARGETS];

// Parts of the band in a row that are looked at one by one; of longer rows only those at either end are.
const int LOOKED_AT = 10;
const int AT_ENDS = 3;

uint first_edge, end_edge;
vec2 at;  // the texel's centre, about the anchor

// Signed distance inside of edge e and its unit normal at t.
vec3 line_at(uint e, float t) {
    vec4 line = edges[e].start + t * edges[e].change;
    return vec3(line.xy, dot(line.xy, at) + line.z) * inversesqrt(dot(line.xy, line.xy));
}

// Covered part of a texel whose centre lies `h` inside a half-plane.
float half_plane_share(vec2 normal, float h) {
    vec2 n = abs(normal);
    float sum = 0.5 * (n.x + n.y), difference = 0.5 * abs(n.x - n.y);
    float a = abs(h);
    float missing = max(sum - a, 0.0);
    float share = a <= difference ? 0.5 + a / max(n.x, n.y) : 1.0 - missing * missing / max(2.0 * n.x * n.y, 1e-12);
    return h >= 0.0 ? share : 1.0 - share;
}

// Part of the line `own` (a point p of it is -h n + s perpendicular) within the half-plane `other`, as an interval of s.
// Of two lines that are the same the one of the lower index counts.
vec2 cut(vec2 interval, vec3 own, vec3 other, bool own_first) {
    float along = own.x * other.y - own.y * other.x;
    float inside = other.z - own.z * dot(own.xy, other.xy);  // of the other, at s = 0
    if (abs(along) < 1e-7) {
        bool out_of_it = inside < 0.0 || (inside == 0.0 && !own_first && dot(own.xy, other.xy) > 0.0);
        return out_of_it ? vec2(1.0, -1.0) : interval;
    }
    float s = -inside / along;
    return along > 0.0 ? vec2(max(interval.x, s), interval.y) : vec2(interval.x, min(interval.y, s));
}

// Area of the polygon's part in the texel at t, by the lengths of what bounds it times their distance from the texel's centre.
float clipped_area(float t) {
    float twice = 0.0;
    vec4 side_lo = vec4(-0.5), side_hi = vec4(0.5);  // the texel's sides left, right, below, above
    for (uint e = first_edge; e < end_edge; ++e) {
        vec3 own = line_at(e, t);
        float reach = 0.5 * (abs(own.x) + abs(own.y));
        if (own.z <= -reach) return 0.0;
        if (own.z >= reach) continue;
        // Within the texel: perpendicular is (-y, x).
        vec2 foot = -own.z * own.xy;
        vec2 interval = vec2(-1.0, 1.0);
        if (abs(own.y) > 1e-7) {
            vec2 s = (vec2(-0.5, 0.5) - foot.x) / -own.y;
            interval = vec2(max(interval.x, min(s.x, s.y)), min(interval.y, max(s.x, s.y)));
        }
        if (abs(own.x) > 1e-7) {
            vec2 s = (vec2(-0.5, 0.5) - foot.y) / own.x;
            interval = vec2(max(interval.x, min(s.x, s.y)), min(interval.y, max(s.x, s.y)));
        }
        for (uint f = first_edge; f < end_edge; ++f) {
            if (f != e) interval = cut(interval, own, line_at(f, t), e < f);
        }
        twice += own.z * max(interval.y - interval.x, 0.0);

        // The texel's sides within this edge: own.x * x + own.y * y + h >= 0 at x or y = ∓½.
        vec4 inside = vec4(own.z) + 0.5 * vec4(-own.x, own.x, -own.y, own.y);
        vec4 along = vec4(own.y, own.y, own.x, own.x);
        vec4 s = -inside / mix(along, vec4(1e-12), lessThan(abs(along), vec4(1e-12)));
        bvec4 flat_side = lessThan(abs(along), vec4(1e-7));
        for (int i = 0; i < 4; ++i) {
            if (flat_side[i]) {
                if (inside[i] < 0.0) side_hi[i] = -1.0;
            } else if (along[i] > 0.0) {
                side_lo[i] = max(side_lo[i], s[i]);
            } else {
                side_hi[i] = min(side_hi[i], s[i]);
            }
        }
    }
    vec4 sides = max(side_hi - side_lo, vec4(0.0));
    twice += 0.5 * (sides.x + sides.y + sides.z + sides.w);
    return clamp(0.5 * twice, 0.0, 1.0);
}

// Covered part of the texel at t.
float share_at(float t) {
    int partial = 0;
    vec3 last = vec3(0.0);
    for (uint e = first_edge; e < end_edge; ++e) {
        vec3 line = line_at(e, t);
        float reach = 0.5 * (abs(line.x) + abs(line.y));
        if (line.z <= -reach) return 0.0;
        if (line.z < reach) {
            ++partial;
            last = line;
        }
    }
    if (partial == 0) return 1.0;
    return partial == 1 ? half_plane_share(last.xy, last.z) : clipped_area(t);
}

vec4 curve_at(uint first, float place, uint stride) {
    uint i = min(uint(place), stride - 2u);
    return mix(curve[first + i], curve[first + i + 1u], place - float(i));
}

// Where start + t change is positive in [0, 1].
vec2 positive(vec2 interval, float start, float change) {
    float end = start + change;
    if (start <= 0.0) interval.x = end > 0.0 ? max(interval.x, start / (start - end)) : 2.0;
    if (end <= 0.0) interval.y = start > 0.0 ? min(interval.y, start / (start - end)) : -1.0;
    return interval;
}

void main() {
    BeamRecord beam = beams[polygon];
    first_edge = beam.first_edge;
    end_edge = first_edge + beam.edge_count;
    at = gl_FragCoord.xy - beam.anchor;
    for (int g = 0; g < TARGETS; ++g) deposited[g] = vec4(0.0);

    vec2 touched = vec2(0.0, 1.0), whole = vec2(0.0, 1.0);
    for (uint e = first_edge; e < end_edge; ++e) {
        vec4 start = edges[e].start, change = edges[e].change;
        float h = dot(start.xy, at) + start.z, dh = dot(change.xy, at) + change.z;
        touched = positive(touched, h + start.w, dh + change.w);
        whole = positive(whole, h - start.w, dh - change.w);
    }
    if (touched.x >= touched.y) discard;

    // Parts whose middles lie in the intervals.
    int first = max(int(ceil(touched.x * beam.nodes - 0.5)), 0);
    int last = min(int(floor(touched.y * beam.nodes - 0.5)), int(beam.nodes) - 1);
    int whole_first = max(int(ceil(whole.x * beam.nodes - 0.5)), 0);
    int whole_last = whole.x <= whole.y ? min(int(floor(whole.y * beam.nodes - 0.5)), int(beam.nodes) - 1) : -1;
    if (whole_last < whole_first) {
        whole_first = last + 1;
        whole_last = last;
    }

    float per_node = 1.0 / beam.nodes;
    float tilt = max(beam.level + dot(beam.slope, at), 0.0);
    float scale = beam.place.y * per_node;
    vec4 below[TARGETS];
    for (int g = 0; g < TARGETS; ++g) below[g] = curve_at(beam.curve + uint(g) * beam.curve_stride, beam.place.x + float(first) * scale, beam.curve_stride);
    int k = first;
    while (k <= last) {
        int end = k + 1;
        if (k == whole_first && whole_last >= k) {
            end = whole_last + 1;
        } else {
            bool is_before = k < whole_first;
            int row_first = is_before ? first : whole_last + 1, row_end = is_before ? min(whole_first, last + 1) : last + 1;
            int row = row_end - row_first;
            if (row > LOOKED_AT && k - row_first >= AT_ENDS && row_end - k > AT_ENDS) {
                int step = (row - 2 * AT_ENDS + LOOKED_AT - 2 * AT_ENDS - 1) / (LOOKED_AT - 2 * AT_ENDS);
                end = min(k + step, row_end - AT_ENDS);
            }
        }
        float t = 0.5 * float(k + end) * per_node;
        float share = k == whole_first ? 1.0 : share_at(t);
        share *= tilt * (beam.density.x + t * (beam.density.y + t * beam.density.z));
        for (int g = 0; g < TARGETS; ++g) {
            vec4 above = curve_at(beam.curve + uint(g) * beam.curve_stride, beam.place.x + float(end) * scale, beam.curve_stride);
            deposited[g] += share * (above - below[g]);
            below[g] = above;
        }
        k = end;
    }
}
