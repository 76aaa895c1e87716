// The part of a texel that a beam polygon covers at one place of its band, exactly.
layout(binding = 0) uniform usampler2D beams;

flat in ivec2 polygon;
flat in vec4 anchor_slope;
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
#else
#define EDGE_COUNT int(band.w)
#define EDGE_START(e) FETCHED(2 * (e))
#define EDGE_CHANGE(e) FETCHED(2 * (e) + 1)
#endif

// An `if` that a software renderer leaves out where no texel takes it: it runs both sides of an `if`, but ends a loop that none is in.
#define WHEN(condition) for (bool wanted = (condition); wanted; wanted = false)

vec2 at;  // the texel's centre, about the anchor

vec3 normalized_line(vec3 line) { return line * inversesqrt(dot(line.xy, line.xy)); }

// Covered part of a texel whose centre lies `h` inside a half-plane.
float half_plane_share(vec2 normal, float h) {
    vec2 n = abs(normal);
    float sum = 0.5 * (n.x + n.y), difference = 0.5 * abs(n.x - n.y);
    float a = abs(h);
    float missing = max(sum - a, 0.0);
    float share = a <= difference ? 0.5 + a / max(n.x, n.y) : 1.0 - missing * missing / max(2.0 * n.x * n.y, 1e-12);
    return h >= 0.0 ? share : 1.0 - share;
}

// Part of the line `own` (a point of it is -h n + s perpendicular) within the half-plane `other`, as an interval of s. Of two lines that are the same one counts.
vec2 cut(vec2 interval, vec3 own, vec3 other, bool own_first) {
    float along = own.x * other.y - own.y * other.x;
    float inside = other.z - own.z * dot(own.xy, other.xy);  // of the other, at s = 0
    float s = -inside / along;
    bool is_parallel = abs(along) < 1e-7;
    bool nothing = is_parallel && (inside < 0.0 || (inside == 0.0 && !own_first && dot(own.xy, other.xy) > 0.0));
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

// Area within the texel of an intersection of half-planes: the lengths of what bounds it times their distance from the texel's centre.
float area_of(vec3 lines[4], int count) {
    float twice = 0.0;
    vec4 low = vec4(-0.5), high = vec4(0.5);
    for (int e = 0; e < 4; ++e) {
        if (e >= count) break;
        vec2 interval = in_texel(lines[e]);
        for (int f = 0; f < 4; ++f) {
            if (f != e && f < count) interval = cut(interval, lines[e], lines[f], e < f);
        }
        twice += lines[e].z * max(interval.y - interval.x, 0.0);
        cut_sides(lines[e], low, high);
    }
    vec4 sides = max(high - low, vec4(0.0));
    return clamp(0.5 * twice + 0.25 * (sides.x + sides.y + sides.z + sides.w), 0.0, 1.0);
}

vec3 line_at(int e, float t) {
    vec4 line = FETCHED(2 * e) + t * FETCHED(2 * e + 1);
    return normalized_line(vec3(line.xy, dot(line.xy, at) + line.z));
}

// The same for any number of edges.
float area_of_all(float t) {
    float twice = 0.0;
    vec4 low = vec4(-0.5), high = vec4(0.5);
    int count = int(band.w);
    for (int e = 0; e < count; ++e) {
        vec3 own = line_at(e, t);
        if (own.z >= 0.75) continue;
        vec2 interval = in_texel(own);
        for (int f = 0; f < count; ++f) {
            if (f != e) interval = cut(interval, own, line_at(f, t), e < f);
        }
        twice += own.z * max(interval.y - interval.x, 0.0);
        cut_sides(own, low, high);
    }
    vec4 sides = max(high - low, vec4(0.0));
    return clamp(0.5 * twice + 0.25 * (sides.x + sides.y + sides.z + sides.w), 0.0, 1.0);
}

// Covered part of the texel at t.
float covered_share(float t) {
    int count = 0;
    bool outside = false;
    vec3 lines[4] = vec3[4](vec3(0.0), vec3(0.0), vec3(0.0), vec3(0.0));
    for (int e = 0; e < EDGE_COUNT; ++e) {
        vec4 line = EDGE_START(e) + t * EDGE_CHANGE(e);
        float h = dot(line.xy, at) + line.z;
        outside = outside || h <= -line.w;
        if (h < line.w) {
            lines[3] = lines[2];
            lines[2] = lines[1];
            lines[1] = lines[0];
            lines[0] = vec3(line.xy, h);
            ++count;
        }
    }
    float share = outside ? 0.0 : 1.0;
    WHEN (!outside && count > 0) {
        lines[0] = normalized_line(lines[0]);
        share = half_plane_share(lines[0].xy, lines[0].z);
        WHEN (count > 1 && count <= 4) {
            for (int i = 1; i < 4; ++i) {
                if (i < count) lines[i] = normalized_line(lines[i]);
            }
            share = area_of(lines, count);
        }
        WHEN (count > 4) share = area_of_all(t);
    }
    return share;
}
