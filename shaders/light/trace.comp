// One specular event for every ray in flight: to the nearest surface, then reflection and
// refraction with all derivative columns. A ray leaves at most two children (or one photon on a
// receiver) in slots of its own; `queue_*.comp` list the living ones in order for the next call, so
// results do not depend on how threads were scheduled.
layout(local_size_x = 64) in;

#include "lib/finite.glsl"
#include "lib/random.glsl"
#include "lib/lattice.glsl"
#include "lib/medium.glsl"
#include "lib/band.glsl"
#include "lib/interface.glsl"
#ifdef FOOTPRINTS
#include "lib/fan.glsl"
#endif
#include "light/trace_records.glsl"
#ifdef HAS_GRATING
#include "lib/grating.glsl"
#endif
#if defined(ROUGH_SURFACES) || defined(LAMP_COLUMNS)
#include "lib/footprint.glsl"
#endif
#ifdef ROUGH_SURFACES
#include "lib/rough_surface.glsl"
#endif

// Change of W per spacing: more is no footprint.
#define FAN_LIMIT 1e4
// Narrower bands are not cut at total internal reflection.
#define MIN_CUT_BAND 1e-4
// A grating of up to so many orders sends each on as a whole lattice where it is met first.
#define MAX_WHOLE_ORDERS 3u
// Bits of `flags` from which on the order of a grating stands that is to be sent on next.
#define ORDER_BIT 8

#if defined(NORMAL_DERIVATIVES) || defined(LOBE_COLUMNS)
#define HAS_NORMAL_COLUMNS
// Derivatives of the shading normal by the ray's columns.
vec3 normal_columns[COLUMNS];
#define NORMAL_COLUMN(c) normal_columns[c]
#else
#define NORMAL_COLUMN(c) vec3(0.0)
#endif
#ifdef POLARISED
#include "light/trace_polarisation.glsl"
#endif
#ifdef ROUGH_SURFACES
// Width of GGX of the object that a ray has met; 0: it is polished. And the table of what that sends on.
float surface_width, surface_table;
#endif

// What a weight at each of the three places adds to the integral of the weights, straight between them, times the density whose running integral
// stands in `row`. Simpson's rule for the running integral's own: exact where the density is quadratic over half a band.
vec3 band_powers(uint row, vec3 band)
{
    float low = spectral_row(row, band.x), anchor = spectral_row(row, band.y), high = spectral_row(row, band.z);
    float below = spectral_row(row, 0.5 * (band.x + band.y)), above = spectral_row(row, 0.5 * (band.y + band.z));
    // Parts of the power of each half that count by its upper end.
    float upper = (5.0 * (anchor - low) - 4.0 * (below - low)) / 6.0;
    float uppermost = (5.0 * (high - anchor) - 4.0 * (above - anchor)) / 6.0;
    return vec3(anchor - low - upper, upper + high - anchor - uppermost, uppermost);
}

#ifdef TINT_LEVELS
// Of the sequence by which levels are rounded, neither of the lattice's own.
#define TINT_GENERATOR 3774877043u

// How far a ray has come through the glass whose tint has levels: up or down to one of them, the same way all along its path.
uint tint_level(RayRecord ray)
{
    float rounding = kronecker(ray.photon_id / p.lattices, TINT_GENERATOR, p.tint_key + ray.photon_id % p.lattices * 2654435769u);
    float place = min(float(TINT_LEVELS) * ray.tinted.x / (1.0 + ray.tinted.x), float(TINT_LEVELS - 1)), level = floor(place);
    // What is left falls the less the less of it there is: odds of a half lie before or behind the middle.
    float halfway = p.tint_halfway[uint(level) >> 2][uint(level) & 3u], beyond = (place - level) * halfway;
    float further = beyond / (beyond + (1.0 - (place - level)) * (1.0 - halfway));
    return uint(level) + (rounding >= 1.0 - further && level < float(TINT_LEVELS - 1) ? 1u : 0u);
}
#endif

// Row of what is left of the light's power, over the spectrum, where a ray has come to.
uint power_row(RayRecord ray)
{
#ifdef TINT_LEVELS
    return uint(p.power_row) + tint_level(ray);
#else
    return uint(p.power_row);
#endif
}

// What throughput at a band's low end, anchor and high end each add to the power a ray carries, W (`band_powers`), for the rays of this event.
vec3 band_w;

// Power that a ray carries: its throughput, straight between three places, times the light's power over its band. That is what is drawn where it
// lands, and so what is accounted for; `flux_w` is what its anchor alone would carry.
float carried_w(RayRecord ray)
{
    return ray.x_hi > ray.x_lo ? dot(band_w, ray.throughput) : ray.flux_w;
}

#include "light/roulette.glsl"

#ifdef HERO
// From here on the hero's path is not that of its companions: none of them would have led to it, and it has all of its weight.
void leave_companions(inout RayRecord ray)
{
    ray.throughput *= ray.companion_x.w > 0.0 ? 4.0 : 1.0;
    ray.companion_x.w = 0.0;
    ray.companion_throughput = vec4(0.0);
}

// The share of the hero and its companions together, by which roulette asks: whoever of them leads, the odds are the same.
float common_share(RayRecord ray, float own, vec3 companions)
{
    return ray.companion_x.w > 0.0 ? 0.25 * (own + dot(companions, vec3(1.0))) : own;
}
#endif

#ifdef ABSORPTION
// What the medium on the way takes.
void absorb(inout RayRecord ray, float distance, inout float absorbed_w)
{
    uint row = medium_weight_row(medium_stack(ray));
    if (row == NONE) return;
#ifdef TINT_LEVELS
    if (row == p.tint_row && ray.x_hi > ray.x_lo) {
        float before = carried_w(ray);
        ray.tinted.x += p.tint_rate * distance;
        ray.flux_w *= exp(-spectral_row(uint(WEIGHT_ROW) + row, ray.x_anchor) * distance);
        band_w = band_powers(power_row(ray), band_of(ray));
        float left = carried_w(ray);
        absorbed_w += before - left;
        ray.survival *= left / max(before, 1e-30);
        return;
    }
#endif
    vec3 alpha = spectral_row(uint(WEIGHT_ROW) + row, band_of(ray));
    vec3 kept = exp(-alpha * distance);
    absorbed_w += carried_w(ray);
    ray.flux_w *= kept.y;
    ray.throughput *= kept;
    absorbed_w -= carried_w(ray);
#ifdef HERO
    vec3 companions = exp(-spectral_row(uint(WEIGHT_ROW) + row, ray.companion_x.xyz) * distance);
    ray.companion_throughput.xyz *= companions;
    ray.survival *= common_share(ray, kept.y, companions);
#else
    ray.survival *= kept.y;
#endif
}
#endif

#ifdef FOOTPRINTS
#include "light/trace_widths.glsl"
#endif
#include "light/trace_bands.glsl"
#include "light/trace_landing.glsl"
#include "light/trace_rough.glsl"

#ifdef FOOTPRINTS
// Of the photon's footprint, per spacing of its own lattice.
uint fan_where_it_landed(RayRecord ray, RayRecord start, Hit hit)
{
    vec2 way;
    for (int c = 0; c < 2; ++c) way[c] = change_of_way(start.dposition[c].xyz, start.ddirection[c].xyz, ray.direction, hit.normal_g, hit.distance);
    vec2 fan = fan_of_footprint(ray.dposition[0].xyz, ray.dposition[1].xyz, ray.ddirection[0].xyz, ray.ddirection[1].xyz, way, ray.direction, hit.normal_g);
    fan *= ray.footprint_scale;
    return is_within2(fan, FAN_LIMIT) ? packHalf2x16(fan) : 0u;
}
#endif

// A photon on a receiver. The share that no specular event precedes the camera pass draws.
void land(inout RayRecord ray, RayRecord start, uint receiver, uint triangle, Hit hit, uint slot, inout Outcome outcome)
{
    outcome.what |= ray.depth == 0u ? DIRECT : DEPOSITED;
    outcome.flux_w = carried_w(ray);
    if (ray.depth == 0u) return;
    PhotonRecord photon;
    photon.position = ray.position;
    photon.flux_w = ray.flux_w;
    photon.dposition_ds = vec3(0.0);
    photon.dposition_dt = vec3(0.0);
    photon.fan = 0u;
#ifdef FOOTPRINTS
    photon.dposition_ds = ray.dposition[0].xyz * ray.footprint_scale;
    photon.dposition_dt = ray.dposition[1].xyz * ray.footprint_scale;
    photon.fan = fan_where_it_landed(ray, start, hit);
#endif
    uint lattice_bits = p.lattice_bits;
#ifdef LAMP_COLUMNS
    // A footprint blurs what light from a point would draw, and an extended light has that coming: the broader of the two is drawn.
    vec2 fan = unpackHalf2x16(photon.fan);
#ifdef LOBE_COLUMNS
    narrow_lamp_by_lobe(ray);
#endif
    if (cover_sides(hit.normal_g, photon.dposition_ds, photon.dposition_dt, fan, ray.dposition[LAMP].xyz, ray.dposition[LAMP + 1].xyz)) {
        lattice_bits = 0u;
        photon.fan = is_within2(fan, FAN_LIMIT) ? packHalf2x16(fan) : 0u;
    }
#endif
#ifdef LOBE_COLUMNS
    if (widen_by_lobe(ray, hit.normal_g, photon.dposition_ds, photon.dposition_dt)) {
        lattice_bits = 0u;
        photon.fan = 0u;
    }
#endif
    photon.x_lo = ray.x_lo;
    photon.x_hi = ray.x_hi;
    photon.throughput = ray.throughput;
#ifdef HERO
    photon.companion_x = ray.companion_x;
    photon.companion_throughput = ray.companion_throughput;
#endif
    photon.x_anchor = ray.x_anchor;
    photon.triangle = triangle;
    photon.receiver = receiver;
    photon.photon_id = ray.photon_id;
    photon.light_and_source = ray.light_and_source;
    photon.branch_key = ray.branch_key;
    photon.depth = min(ray.depth, (1u << EDGE_BIT) - 1u);
#ifdef LIGHT_EDGES
    // The edge is told in steps of the lattice as emitted: footprints of a coarser one, or broader ones, reach over it from farther away.
    if (lattice_bits == p.lattice_bits && ray.footprint_scale == 1.0) photon.depth |= uint(ray.dposition[0].w) << EDGE_BIT;
#endif
#if SPECTRAL_GROUPS > 0
    SPECTRAL_COPY
#endif
    bool holds = true;
#if COLUMNS > 0
    for (int c = 0; c < COLUMNS; ++c) {
        float widened = c < SPATIAL ? ray.footprint_scale * ray.footprint_scale : 1.0;
        holds = holds && is_within(widened * dot(ray.dposition[c].xyz, ray.dposition[c].xyz), COLUMN_LIMIT * COLUMN_LIMIT);
    }
#endif
    if (!holds) {
        ray.flags |= FLAG_FOOTPRINT_DROPPED;
        outcome.what |= FELL_FOOTPRINT;
    }
    photon.flags = (ray.flags & FLAG_FOOTPRINT_DROPPED) | lattice_bits;
#ifdef TINT_LEVELS
    photon.flags |= tint_level(ray) << uint(TINT_BIT);
#endif
    store_photon(slot, photon);
    outcome.what |= LEFT_PHOTON;
}

#include "light/trace_scatter.glsl"

#ifdef BEAMS
// Whether beams carry what meets this object first.
bool is_beam_object(uint object)
{
    return ((p.beam_objects[object >> 7u][(object >> 5u) & 3u] >> (object & 31u)) & 1u) != 0u;
}
#endif

#ifdef FLIGHTS
// The ray's way to what it meets; it has come so far through haze then.
Flight flight_of(inout RayRecord ray, float distance)
{
    // What is left of a grating's orders has flown here before.
    bool outside = !is_inside(medium_stack(ray)) && (ray.flags >> uint(ORDER_BIT)) == 0u;
    Flight flight;
    flight.position = ray.position;
    flight.direction = ray.direction;
    flight.distance = distance;
    flight.flux_w = outside ? carried_w(ray) : 0.0;
    flight.flown = ray.flown.x;
    flight.x_lo = ray.x_lo;
    flight.x_hi = ray.x_hi;
    flight.light_and_source = ray.light_and_source;
    flight.photon_id = ray.photon_id;
    flight.what = ray.depth << 8u;
    flight.dposition_ds = ray.footprint_scale * ray.dposition[0].xyz;
    flight.dposition_dt = ray.footprint_scale * ray.dposition[1].xyz;
    flight.ddirection_ds = ray.footprint_scale * ray.ddirection[0].xyz;
    flight.ddirection_dt = ray.footprint_scale * ray.ddirection[1].xyz;
    flight.dposition_dband = flight.ddirection_dband = vec3(0.0);
#if SPECTRAL_GROUPS > 0
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float over_band = variable_step(uint(g), ray.x_hi, ray.x_lo);
        flight.dposition_dband += over_band * ray.dposition[SPATIAL + g].xyz;
        flight.ddirection_dband += over_band * ray.ddirection[SPATIAL + g].xyz;
    }
#endif
    ray.flown.x += is_inside(medium_stack(ray)) ? 0.0 : distance;
    return flight;
}
#endif

void main()
{
    uint k = gl_GlobalInvocationID.x;
    if (k >= state.alive) return;
    RayRecord ray = load_ray(indices[k]);
#if SPECTRAL_GROUPS > 0
    keep_sweeps_within(ray);
#endif
    RayRecord start = ray;
    Outcome outcome = Outcome(0u, 0.0, 0.0, 0.0);
#ifndef POINT_SPECTRUM
    band_w = band_powers(power_row(ray), band_of(ray));
#endif

    RayOrigin origin = RayOrigin(ray.last_primitive, ray.last_object, uint((ray.flags & FLAG_INSIDE) != 0u), ray.inside_mask);
    Hit hit;
    float border = -1.0;
#ifdef LANDING_CUTS
    bool met = meet_with_band(ray, origin, hit, border);
#else
    bool met = intersect_closest(ray.position, ray.direction, FAR_DISTANCE, origin, hit);
#endif
#ifdef LOOPS_MAY_END
    // llvmpipe ends every loop of an invocation once they have run 65,535 rounds together, and goes on with what there is.
    uint rounds = 0u;
    while (rounds < 2u) rounds += min(p.lattices, 1u);
    if (rounds < 2u) {
        outcomes[k] = uvec4(LOST_NUMERIC, floatBitsToUint(carried_w(ray)), 0u, 0u);
        return;
    }
#endif
    // Looked up once for all branches; some object and facet where nothing was met.
    Object thing = object_at(met ? hit.object : 0u);
    Triangle facet = hit_triangle(hit);
    uint kind = met ? thing.kind : NONE;

#ifdef FLIGHTS
    Flight flight = flight_of(ray, met ? hit.distance : FAR_DISTANCE);
#endif
#ifdef ABSORPTION
    if (met) absorb(ray, hit.distance, outcome.absorbed_w);
#endif
#ifdef ROUGH_SURFACES
    surface_width = kind == KIND_DIELECTRIC ? thing.colour.x : 0.0;
    surface_table = thing.colour.y;
#endif
    if (met) ray.position = surface_point(hit, facet, ray.position, ray.direction);
#ifdef FOOTPRINTS
    if (ray.depth > 0u) keep_directions_within(ray);
#endif
#ifdef LAMP_COLUMNS
    if (met && ray.depth > 0u && p.bounded != 0u) keep_pair_above(ray, LAMP, hit.normal_g);
#endif
#ifdef LOBE_COLUMNS
    if (met && p.bounded != 0u) keep_pair_above(ray, LOBE, hit.normal_g);
#endif
#if COLUMNS > 0
    for (int c = 0; c < COLUMNS; ++c)
        ray.dposition[c].xyz = transfer_column(ray.dposition[c].xyz, ray.ddirection[c].xyz, ray.direction, hit.normal_g, hit.distance);
#endif

#ifdef FOOTPRINTS
    if (IS_GLASS(kind) || kind == KIND_MIRROR) keep_columns_within(ray, start, thing.kind == KIND_MIRROR ? thing.colour.w : thing.colour.z, hit.distance);
#endif

#ifdef BEAMS
    if (met && (ray.light_and_source >> 16) == 0xffffu && is_beam_object(hit.object)) {
        outcome = Outcome(LEFT_TO_BEAMS, carried_w(ray), 0.0, 0.0);
    } else
#endif
    if (kind == KIND_DIFFUSE && border < 0.0) {
        land(ray, start, thing.receiver, facet.source, hit, k, outcome);
    } else if (kind == KIND_BLACK && border < 0.0) {
        outcome.what |= ABSORBED;
        outcome.flux_w = carried_w(ray);
    } else if (kind == NONE) {
        // A ray that leaves the scene from inside a solid slipped through a crack.
        outcome.what |= is_inside(medium_stack(ray)) ? LOST_NUMERIC : ESCAPED;
        outcome.flux_w = carried_w(ray);
    } else if (ray.depth >= p.max_depth && border < 0.0) {
        outcome.what |= LOST_DEPTH;
        outcome.flux_w = carried_w(ray);
    } else {
        scatter(ray, start, hit, shading_frame(hit, facet, ray.position, ray.direction), kind, thing, border, k, outcome);
    }
#ifdef FLIGHTS
#ifdef BAND_CUTS
    // The parts of a band that is cut fly again.
    if ((outcome.what & FELL_BAND) != 0u) flight.flux_w = 0.0;
#endif
    flight.what |= kind == KIND_DIFFUSE || kind == KIND_BLACK || kind == NONE ? 0u : 1u;
    store_flight(state.flights - state.alive + k, flight);
#endif
    store_outcome(k, outcome);
}
