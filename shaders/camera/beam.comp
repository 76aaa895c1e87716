// What a pixel sees by way of one screen polygon: a camera beam that keeps its facets (app/beams/screen_polygons.py). How much of the pixel it covers,
// and at which wavelengths, follows from its edges; the ray that leaves its last facet from its columns. What lies behind is looked up along the sweep as
// for any camera path. An invocation is of one pixel, or of a part of one, of one polygon.
layout(local_size_x = 64) in;

#include "camera/globals.glsl"

#ifdef SPECTRAL_SWEEP
int asked = 0;
#include "camera/cuts.glsl"
#endif

layout(std140, binding = BIND_BEAM_VIEW) uniform View { BeamView view; };
// Polygons' records, then their edges; see lib/scene.glsl for why as texels.
#ifdef SCENE_IMAGE
layout(rgba32ui, binding = IMAGE_POLYGONS) uniform readonly restrict uimage2D polygon_texels;
#else
layout(binding = UNIT_POLYGONS) uniform usampler2D polygon_texels;
#endif

// Polygon; pixel, and which part of it.
layout(std430, binding = BIND_BEAM_ENTRIES) readonly restrict buffer Entries { uvec2 entries[]; };
layout(std430, binding = BIND_BEAM_FOUND) writeonly restrict buffer Found { vec4 found[]; };

// Edges that cross the pixel which are kept at hand; more are fetched for every point.
#define EDGES_KEPT 6

uvec4 polygon_texel(uint i)
{
    ivec2 at = ivec2(int(i & 4095u), int(i >> 12u));
#ifdef SCENE_IMAGE
    return imageLoad(polygon_texels, at);
#else
    return texelFetch(polygon_texels, at, 0);
#endif
}

ScreenPolygon polygon_at(uint index)
{
    uint at = index * uint(ScreenPolygon_TEXELS);
    return ScreenPolygon_FROM(polygon_texel, at);
}

// An edge's line at either end of the band: inside where dot(line.xy, place) + line.z >= 0.
void edge_at(uint edge, out vec3 line_lo, out vec3 line_hi)
{
    uint at = view.first_edge_texel + 2u * edge;
    line_lo = uintBitsToFloat(polygon_texel(at).xyz);
    line_hi = uintBitsToFloat(polygon_texel(at + 1u).xyz);
}

float distance_inside(vec3 line, vec2 place)
{
    return dot(line.xy, place) + line.z;
}

// A vector's parabola over the band, and its two columns', for a place off the polygon's centre.
vec3 at_place(vec4 powers[9], vec2 place, float t)
{
    vec3 coefficients[3];
    for (int k = 0; k < 3; ++k) coefficients[k] = powers[3 * k].xyz + place.x * powers[3 * k + 1].xyz + place.y * powers[3 * k + 2].xyz;
    return coefficients[0] + t * (coefficients[1] + t * coefficients[2]);
}

vec3 column_at(vec4 powers[9], int column, float t)
{
    return powers[column].xyz + t * (powers[3 + column].xyz + t * powers[6 + column].xyz);
}

vec3 normalized_column(vec3 column, vec3 direction)
{
    return column - dot(column, direction) * direction;
}

// The path that has come this way from a place in the pixel, for the wavelengths at [lo, hi] of the polygon's band.
CameraPath path_beyond(ScreenPolygon beam, vec2 place, float lo, float hi)
{
    CameraPath path;
    float middle = 0.5 * (lo + hi), width = beam.x_hi - beam.x_lo;
    path.position = at_place(beam.position, place, middle);
    path.direction = normalize(at_place(beam.direction, place, middle));
    path.origin = RayOrigin(NONE, beam.last_object, uint((beam.flags & 1u) != 0u), beam.inside_mask);
    path.medium = MediumStack(beam.inside_mask, beam.inside_object);
    for (int c = 0; c < 2; ++c) {
        path.dposition[c] = column_at(beam.position, c + 1, middle);
        path.ddirection[c] = normalized_column(column_at(beam.direction, c + 1, middle), path.direction);
    }
    vec3 t = vec3(lo, middle, hi);
    path.band = beam.x_lo + width * t;
    path.weight = max(beam.throughput.x + t * (beam.throughput.y + t * beam.throughput.z), 0.0) * max(1.0 + dot(beam.slope, place), 0.0);
    path.inverse_pdf = 1.0;
    path.branch_weight = path.weight.y;
    path.key = beam.key;
    path.depth = int(beam.flags >> 8u);
    path.restricted = uint(width * (hi - lo) < 0.999);
    path.recut = 0u;
    path.planar_so_far = 1u;
    path.cuts = 0;
#ifdef SPECTRAL_SWEEP
    // The one column is by x itself: the parabola's slope in the middle.
    for (int end = 0; end < 2; ++end) {
        float at = end == 0 ? lo : hi;
        path.end_position[end] = at_place(beam.position, place, at);
        path.end_direction[end] = normalize(at_place(beam.direction, place, at));
    }
    float per_x = 1.0 / (width * max(hi - lo, 1e-6));
    path.dposition[SPATIAL] = per_x * (path.end_position[1] - path.end_position[0]);
    path.ddirection[SPATIAL] = normalized_column(per_x * (path.end_direction[1] - path.end_direction[0]), path.direction);
    set_steps(path);
    // A whole spectrum that has been bent is swept as well.
    vec3 moved = path.end_direction[1] - path.end_direction[0], shifted = path.end_position[1] - path.end_position[0];
    path.restricted = uint(path.restricted != 0u || dot(moved, moved) + dot(shifted, shifted) > 1e-14);
#endif
    return path;
}

// Adds what lies behind.
void look_behind(CameraPath path, uint pixel_key)
{
    Hit hit;
    bool met = intersect_closest(path.position, path.direction, FAR_DISTANCE, path.origin, hit);
    uint kind = met ? object_at(hit.object).kind : NONE;
    // What should not be there: the beam would have been handed over. It is as if light were caught behind.
    bool unexpected = is_specular(kind), same_hit = true;
    if (unexpected) atomicAdd(fallbacks[FELL_DEPTH], 1u);
    met = met && !unexpected;
#ifdef SPECTRAL_SWEEP
    bool asks = path.restricted != 0u && kind != KIND_BLACK && !unexpected && sweep_pixels(path, met ? hit.distance : FAR_DISTANCE) > MIN_SWEEP;
    for (int end = 0; end < 2 && asks; ++end) {
        bool same = true;
        Hit other;
        follows_same_path(path, end == 0 ? path.band.x : path.band.z, met, true, hit, same, other);
        same_hit = same_hit && same;
    }
#endif
#if defined(LAYER_BEAUTY) && defined(VISIBLE_LIGHTS)
    add_lights(path, met ? hit.distance : FAR_DISTANCE);
#endif
    if (!met || kind == KIND_DIFFUSE) add_end(path, met, hit, same_hit, pixel_key);
}

void main()
{
    uint index = gl_GlobalInvocationID.x;
    if (index >= view.entry_count) return;
    uvec2 entry = entries[index];
    uint number = bitfieldExtract(entry.y, 0, PIXEL_BITS), part = entry.y >> PIXEL_BITS;
    uvec2 pixel = uvec2(number % p.size.x, number / p.size.x);
    for (int t = 0; t < TARGETS; ++t) radiance[t] = vec4(0.0);
    ScreenPolygon beam = polygon_at(entry.x);
    vec2 middle = vec2(pixel) + 0.5 - beam.centre;

    // Edges that pass through the pixel; few do.
    vec3 kept_lo[EDGES_KEPT], kept_hi[EDGES_KEPT];
    int kept = 0;
    uint beyond = beam.end_edge;
    for (uint e = beam.first_edge; e < beam.end_edge; ++e) {
        vec3 line_lo, line_hi;
        edge_at(e, line_lo, line_hi);
        vec2 at = vec2(distance_inside(line_lo, middle), distance_inside(line_hi, middle));
        vec2 reach = view.reach * vec2(abs(line_lo.x) + abs(line_lo.y), abs(line_hi.x) + abs(line_hi.y));
        if (any(lessThan(at, reach))) {
            if (kept == EDGES_KEPT) beyond = min(beyond, e);
            for (int k = 0; k < EDGES_KEPT; ++k)
                if (k == kept) {
                    kept_lo[k] = line_lo;
                    kept_hi[k] = line_hi;
                }
            kept = min(kept + 1, EDGES_KEPT);
        }
    }

    uint points_of_part = view.points / beam.parts;
    cover.low = cover.high = vec4(0.0);
    cover.x_lo = beam.x_lo;
    cover.per_x = 1.0 / max(beam.x_hi - beam.x_lo, 1e-6);
    float t_lo = 1.0, t_hi = 0.0, sum = 0.0;
    vec2 centre_seen = vec2(0.0);
    for (uint i = part * points_of_part; i < (part + 1u) * points_of_part; ++i) {
        vec4 two = view.places[i >> 1u];
        vec2 place = middle + ((i & 1u) == 0u ? two.xy : two.zw);
        float lo = 0.0, hi = 1.0;
        for (int k = 0; k < EDGES_KEPT; ++k)
            if (k < kept) cut_interval(distance_inside(kept_lo[k], place), distance_inside(kept_hi[k], place), lo, hi);
        for (uint e = beyond; e < beam.end_edge; ++e) {
            vec3 line_lo, line_hi;
            edge_at(e, line_lo, line_hi);
            cut_interval(distance_inside(line_lo, place), distance_inside(line_hi, place), lo, hi);
        }
        if (hi > lo) {
            add_cover(lo, hi);
            t_lo = min(t_lo, lo);
            t_hi = max(t_hi, hi);
            centre_seen += (hi - lo) * place;
            sum += hi - lo;
        }
    }
    if (sum > 0.0) {
        float per_point = 1.0 / float(view.points);
        cover.low *= per_point;
        cover.high *= per_point;
        cover.varies = any(notEqual(vec4(cover.low.x), cover.low)) || any(notEqual(vec4(cover.low.x), cover.high));
        beam_side = sqrt(min(sum * per_point / max(t_hi - t_lo, 1e-3), 1.0));
        beam_draw = part;
        uint pixel_key = hash_combine(hash_combine(hash_combine(p.seed, pixel.x), pixel.y), beam.key);
        look_behind(path_beyond(beam, centre_seen / sum, t_lo, t_hi), pixel_key);
    }
    for (int t = 0; t < TARGETS; ++t) found[index * uint(TARGETS) + uint(t)] = radiance[t];
}
