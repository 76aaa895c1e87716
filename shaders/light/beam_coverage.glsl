// The part of a texel that a beam polygon covers at one place of its band, exactly.
layout(binding = 0) uniform usampler2D beams;

flat in ivec2 polygon;
flat in vec4 anchor_slope;
flat in vec2 perspective;
flat in vec4 density_nodes;
flat in vec4 band;  // place on the curve, length there, the curve's row, edges
flat in vec4 whole_energy[TARGETS];

// Edges are flat inputs up to EDGES of them, read from the texture where there are more.
#define FETCHED(i) uintBitsToFloat(texelFetch(beams, polygon + ivec2(BeamRecord_TEXELS + (i), 0), 0))
#if EDGES > 0
flat in vec4 edge[2 * EDGES];
#define EDGE_COUNT EDGES
#define EDGE_START(e) edge[2 * (e)]
#define EDGE_CHANGE(e) edge[2 * (e) + 1]
#define EDGE_OF(list, i) int(list & 15u)
#define LISTED crossings
#else
#define EDGE_COUNT int(band.w)
#define EDGE_START(e) FETCHED(2 * (e))
#define EDGE_CHANGE(e) FETCHED(2 * (e) + 1)
#define IS_LISTED (EDGE_COUNT <= 16 && crossings <= 8)
#define EDGE_OF(list, i) (IS_LISTED ? int(list & 15u) : i)
#define LISTED (crossings == 0 ? 0 : IS_LISTED ? crossings : EDGE_COUNT)
#endif

vec2 at;  // the texel's centre, about the anchor

#if CONTACT_LINES
// How much smaller than a texel that is which is looked at, by the squares of their sides.
float window_less = 0.0;
float window_of(float window) { return sqrt(max(window * window - window_less, 1.0 - window_less)); }
#else
#define window_of(window) (window)
#endif

// A line's unit normal and distance inside, in units of its window: a texel, or a square as wide as the penumbra.
vec3 normalized_line(vec3 line, float window) {
    return vec3(line.xy, line.z / window_of(window)) * inversesqrt(dot(line.xy, line.xy));
}

// Half of what the window spans across a line.
float reach_of(vec4 line) { return 0.5 * (abs(line.x) + abs(line.y)) * window_of(line.w); }

// Part of the line `own` (a point of it is -h n + s perpendicular) within the half-plane `other`, as an interval of s.
// Of two lines that are the same one counts.
vec2 cut(vec2 interval, vec3 own, vec3 other, bool own_first) {
    float along = own.x * other.y - own.y * other.x;
    float turn = dot(own.xy, other.xy);
    float s = (own.z * turn - other.z) / along;
    bool is_parallel = abs(along) < 1e-7;
    // Differences of the same two numbers, so that of two lines in one place exactly one counts however they are
    // rounded.
    float inside = turn > 0.0 ? other.z - own.z : other.z + own.z;
    bool nothing = is_parallel && (inside < 0.0 || (inside == 0.0 && !own_first && turn > 0.0));
    float low = nothing ? 1.0 : is_parallel || along < 0.0 ? interval.x : max(interval.x, s);
    float high = nothing ? -1.0 : is_parallel || along > 0.0 ? interval.y : min(interval.y, s);
    return vec2(low, high);
}

// The part of a line that lies in the texel.
vec2 in_texel(vec3 own) {
    vec2 foot = -own.z * own.xy;
    vec2 along = vec2(-own.y, own.x);
    along = mix(along, vec2(1e-9), lessThan(abs(along), vec2(1e-9)));
    vec2 a = (-0.5 - foot) / along, b = (0.5 - foot) / along;
    vec2 low = min(a, b), high = max(a, b);
    return vec2(max(low.x, low.y), min(high.x, high.y));
}

// The texel's sides (left, right, below, above) as intervals, cut by a half-plane.
void cut_sides(vec3 own, inout vec4 low, inout vec4 high) {
    vec4 inside = vec4(own.z) + 0.5 * vec4(-own.x, own.x, -own.y, own.y);
    vec4 along = vec4(own.y, own.y, own.x, own.x);
    along = mix(along, vec4(1e-9), lessThan(abs(along), vec4(1e-9)));
    vec4 s = -inside / along;
    bvec4 rises = greaterThan(along, vec4(0.0));
    low = mix(low, max(low, s), rises);
    high = mix(min(high, s), high, rises);
}

vec3 line_at(int e, float t) {
    vec4 line = EDGE_START(e) + t * EDGE_CHANGE(e);
    return normalized_line(vec3(line.xy, dot(line.xy, at) + line.z), line.w);
}

// The edges that cross the texel at some time, four bits each; where that is too little all are looked at again.
uint crossing;
int crossings;
// One of them: normal, distance inside, window; and their change over the band. Where none crosses, one that all of the
// texel lies within.
vec4 only_start, only_change;

// Before each place that is looked at: of the last one nothing is kept, neither the list nor the one edge.
void begin_place() {
    crossing = 0u;
    crossings = 0;
    only_start = vec4(1.0, 0.0, 1.0, 1.0);
    only_change = vec4(0.0);
}

// Covered part of the texel at t: the lengths of what bounds it, times their distance from the texel's centre. Loops
// have short bodies, since a software renderer runs a loop that no texel is in once.
float covered_share(float t) {
    bool outside = false;
    float twice = 0.0;
    vec4 low = vec4(-0.5), high = vec4(0.5);
    uint own_left = crossing;
    for (int i = 0; i < LISTED; ++i) {
        int e = EDGE_OF(own_left, i);
        vec3 own = line_at(e, t);
        outside = outside || own.z <= -0.5 * (abs(own.x) + abs(own.y));
        vec2 interval = in_texel(own);
        uint other_left = crossing;
        for (int j = 0; j < LISTED; ++j) {
            int f = EDGE_OF(other_left, j);
            if (f != e) interval = cut(interval, own, line_at(f, t), e < f);
            other_left >>= 4;
        }
        twice += own.z * max(interval.y - interval.x, 0.0);
        cut_sides(own, low, high);
        own_left >>= 4;
    }
    vec4 sides = max(high - low, vec4(0.0));
    return outside ? 0.0 : clamp(0.5 * twice + 0.25 * (sides.x + sides.y + sides.z + sides.w), 0.0, 1.0);
}

// Covered part of the texel at t where one edge alone crosses it.
float half_plane_share(float t) {
    vec4 only = only_start + t * only_change;
    vec3 line = normalized_line(only.xyz, only.w);
    vec2 n = abs(line.xy);
    float sum = 0.5 * (n.x + n.y), difference = 0.5 * abs(n.x - n.y), h = abs(line.z);
    float missing = max(sum - h, 0.0);
    float share = h <= difference ? 0.5 + h / max(n.x, n.y) : 1.0 - missing * missing / max(2.0 * n.x * n.y, 1e-12);
    return line.z >= 0.0 ? share : 1.0 - share;
}

void note_crossing(int e, bool crosses, vec4 start, vec4 change) {
    only_start = crosses ? start : only_start;
    only_change = crosses ? change : only_change;
    crossing = crosses ? crossing << 4 | uint(e) : crossing;
    crossings += crosses ? 1 : 0;
}
