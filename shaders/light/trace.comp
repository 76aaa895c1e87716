// Specular events of every ray in flight: to the nearest surface, then reflection and refraction with all derivative
// columns. A ray leaves at most two children, or one photon on a receiver. Either one event in a dispatch, whose
// children lie in slots of their own: `queue_*.comp` list the living ones in order for the next call, so results do not
// depend on how threads were scheduled. Or several (RAY_POOL): one child is followed where its parent was.
layout(local_size_x = 64) in;

#include "lib/finite.glsl"
#include "lib/random.glsl"
#include "lib/lattice.glsl"
#include "lib/fan.glsl"
#include "light/trace_records.glsl"
#include "lib/footprint.glsl"

// Change of W per spacing: more is no footprint.
#define FAN_LIMIT 1e4
// Narrower bands are not cut at total internal reflection.
#define MIN_CUT_BAND 1e-4

// What a weight at each of the three places adds to the integral of the weights, straight between them, times the
// density whose running integral stands in `row`. Simpson's rule for the running integral's own: exact where the
// density is quadratic over half a band.
vec3 band_powers(uint row, vec3 band) {
    float low = spectral_row(row, band.x), anchor = spectral_row(row, band.y), high = spectral_row(row, band.z);
    float below = spectral_row(row, 0.5 * (band.x + band.y)), above = spectral_row(row, 0.5 * (band.y + band.z));
    // Parts of the power of each half that count by its upper end.
    float upper = (5.0 * (anchor - low) - 4.0 * (below - low)) / 6.0;
    float uppermost = (5.0 * (high - anchor) - 4.0 * (above - anchor)) / 6.0;
    return vec3(anchor - low - upper, upper + high - anchor - uppermost, uppermost);
}

// How far a ray has come through the glass whose tint has levels: up or down to one of them, the same way all along its
// path.
uint tint_level(Path path) {
    float rounding = drawn_evenly(path.walk.photon_id, p.lattices, p.tint_key);
    float place = min(float(TINT_LEVELS) * path.walk.tinted.x / (1.0 + path.walk.tinted.x), float(TINT_LEVELS - 1)),
          level = floor(place);
    // What is left falls the less the less of it there is: odds of a half lie before or behind the middle.
    float halfway = p.tint_halfway[uint(level) >> 2][uint(level) & 3u], beyond = (place - level) * halfway;
    float further = beyond / (beyond + (1.0 - (place - level)) * (1.0 - halfway));
    return uint(level) + (rounding >= 1.0 - further && level < float(TINT_LEVELS - 1) ? 1u : 0u);
}

// Row of what is left of the light's power, over the spectrum, where a ray has come to.
uint power_row(Path path) { return TINT_LEVELS > 0 ? uint(p.power_row) + tint_level(path) : uint(p.power_row); }

// What throughput at a band's low end, anchor and high end each add to the power a ray carries, W (`band_powers`), for
// the rays of this event.
vec3 band_w;

// Power that a ray carries: its throughput, straight between three places, times the light's power over its band. That
// is what is drawn where it lands, and so what is accounted for; `flux_w` is what its anchor alone would carry.
float carried_w(Path path) { return path.band.z > path.band.x ? dot(band_w, path.throughput) : path.walk.flux_w; }

#include "light/roulette.glsl"
#include "light/trace_companions.glsl"

// What the medium on the way takes.
void absorb(inout Path path, float distance, inout float absorbed_w) {
    uint row = medium_weight_row(path.medium);
    if (row == NONE) return;
    if (TINT_LEVELS > 0 && row == p.tint_row && path.band.z > path.band.x) {
        float before = carried_w(path);
        path.walk.tinted.x += p.tint_rate * distance;
        path.walk.flux_w *= exp(-spectral_row(uint(WEIGHT_ROW) + row, path.band.y) * distance);
        band_w = band_powers(power_row(path), path.band);
        float left = carried_w(path);
        absorbed_w += before - left;
        path.walk.survival *= left / max(before, 1e-30);
        return;
    }
    vec3 kept = exp(-spectral_row(uint(WEIGHT_ROW) + row, path.band) * distance);
    vec3 companions = exp(-companion_row(path, uint(WEIGHT_ROW) + row) * distance);
    absorbed_w += carried_w(path);
    weaken(path, kept, companions);
    absorbed_w -= carried_w(path);
    path.walk.survival *= common_share(path, kept.y, companions);
}

#include "light/trace_widths.glsl"
#include "light/trace_bands.glsl"
#include "light/trace_landing.glsl"

// Of the photon's footprint, per spacing of its own lattice.
uint fan_where_it_landed(Path path, Path start, Hit hit) {
    vec2 way;
    for (int c = 0; c < 2; ++c)
        way[c] = change_of_way(start.dposition[c], start.ddirection[c], path.direction, hit.normal_g, hit.distance);
    vec2 fan = fan_of_footprint(path.dposition[0], path.dposition[1], path.ddirection[0], path.ddirection[1], way,
        path.direction, hit.normal_g);
    fan *= path.walk.footprint_scale;
    return is_within2(fan, FAN_LIMIT) ? packHalf2x16(fan) : 0u;
}

// Where a ray has come to, as it set out and as it is there.
struct Arrival {
    Path path, start;
    Hit hit;
    Triangle facet;
    Object thing;
    uint kind;
    float border;  // where its band is cut before it lands; negative: nowhere
};

// A photon on a receiver. The share that no specular event precedes the camera pass draws.
void land(Arrival at, uint slot, inout Outcome outcome) {
    Path path = at.path;
    Hit hit = at.hit;
    outcome.what |= path.depth == 0u ? DIRECT : DEPOSITED;
    outcome.flux_w = carried_w(path);
    if (path.depth == 0u) return;
    PhotonRecord photon;
    photon.position = path.position;
    photon.flux_w = path.walk.flux_w;
    photon.dposition_ds = vec3(0.0);
    photon.dposition_dt = vec3(0.0);
    photon.fan = 0u;
    if (FOOTPRINTS) {
        photon.dposition_ds = path.dposition[0] * path.walk.footprint_scale;
        photon.dposition_dt = path.dposition[1] * path.walk.footprint_scale;
        photon.fan = fan_where_it_landed(path, START(at.start, slot), hit);
    }
    uint lattice_bits = p.lattice_bits;
    if (LAMP_COLUMNS) {
        // A footprint blurs what light from a point would draw, which an extended light blurs anyway: the broader of
        // the two is drawn.
        vec2 fan = unpackHalf2x16(photon.fan);
        if (LOBE_COLUMNS) narrow_lamp_by_lobe(path);
        if (cover_sides(hit.normal_g, photon.dposition_ds, photon.dposition_dt, fan, path.dposition[LAMP],
                path.dposition[LAMP + 1])) {
            lattice_bits = 0u;
            photon.fan = is_within2(fan, FAN_LIMIT) ? packHalf2x16(fan) : 0u;
        }
    }
    if (LOBE_COLUMNS && widen_by_lobe(path, hit.normal_g, photon.dposition_ds, photon.dposition_dt)) {
        lattice_bits = 0u;
        photon.fan = 0u;
    }
    if (LINE_WIDTHS && (path.walk.flags & FLAG_OFF_LATTICE) != 0u) {
        lattice_bits = 0u;
        path.walk.flags &= ~FLAG_OFF_LATTICE;
    }
    photon.x_lo = path.band.x;
    photon.x_hi = path.band.z;
    photon.throughput = path.throughput;
    if (HERO) {
        photon.companion_x = path.walk.companion_x;
        photon.companion_throughput = path.walk.companion_throughput;
    }
    photon.x_anchor = path.band.y;
    photon.triangle = at.facet.source;
    photon.receiver = side_met(at.thing, path.direction, hit.normal_g);
    photon.photon_id = path.walk.photon_id;
    photon.light_and_source = path.walk.light_and_source;
    photon.branch_key = path.walk.branch_key;
    photon.depth = min(path.depth, (1u << EDGE_BIT) - 1u);
    // The edge is told in steps of the lattice as emitted: footprints of a coarser one, or broader ones, reach over
    // it from farther away.
    if (LIGHT_EDGES && lattice_bits == p.lattice_bits && path.walk.footprint_scale == 1.0)
        photon.depth |= uint(path.walk.dposition[0].w) << EDGE_BIT;
#if SPECTRAL_GROUPS > 0
    SPECTRAL_COPY
#endif
    bool holds = true;
    for (int c = 0; c < COLUMNS; ++c) {
        float widened = c < SPATIAL ? path.walk.footprint_scale * path.walk.footprint_scale : 1.0;
        holds = holds && is_within(widened * dot(path.dposition[c], path.dposition[c]), COLUMN_LIMIT * COLUMN_LIMIT);
    }
    if (!holds) {
        path.walk.flags = FLAG_FOOTPRINT_DROPPED;
        outcome.what |= FELL_FOOTPRINT;
    }
    photon.flags = path.walk.flags | lattice_bits;
    if (TINT_LEVELS > 0) photon.flags |= tint_level(path) << uint(TINT_BIT);
    store_photon(slot, photon);
    outcome.what |= LEFT_PHOTON;
}

#include "light/trace_scatter.glsl"

// Whether beams carry what meets this object first.
bool is_beam_object(uint object) {
    return ((p.beam_objects[object >> 7u][(object >> 5u) & 3u] >> (object & 31u)) & 1u) != 0u;
}

// The ray's way to what it meets; it has come so far through haze then.
Flight flight_of(inout Path path, float distance) {
    bool outside = !is_inside(path.medium);
    // What is left of a grating's orders, or a crystal's lobes, has flown here before.
    if (HAS_GRATING || HAS_CRYSTAL) outside = outside && path.order == 0u;
    Flight flight;
    flight.position = path.position;
    flight.direction = path.direction;
    flight.distance = distance;
    flight.flux_w = outside ? carried_w(path) : 0.0;
    flight.flown = path.walk.flown.x;
    flight.x_lo = path.band.x;
    flight.x_hi = path.band.z;
    flight.light_and_source = path.walk.light_and_source;
    flight.photon_id = path.walk.photon_id;
    flight.what = path.depth << 8u;
    flight.dposition_ds = path.walk.footprint_scale * path.dposition[0];
    flight.dposition_dt = path.walk.footprint_scale * path.dposition[1];
    flight.ddirection_ds = path.walk.footprint_scale * path.ddirection[0];
    flight.ddirection_dt = path.walk.footprint_scale * path.ddirection[1];
    flight.dposition_dband = flight.ddirection_dband = vec3(0.0);
    if (SPECTRAL_GROUPS > 0) {
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
            float over_band = variable_step(uint(g), path.band.z, path.band.x);
            flight.dposition_dband += over_band * path.dposition[SPATIAL + g];
            flight.ddirection_dband += over_band * path.ddirection[SPATIAL + g];
        }
    }
    path.walk.flown.x += is_inside(path.medium) ? 0.0 : distance;
    return flight;
}

Flight flight;

#define ENDED 0u
#define LANDS 1u
#define GOES_ON 2u

// Up to what the ray in `slot` meets next: whether it has ended there as `outcome` says, lands on a receiver, or
// `go_past` tells.
uint arrive(uint slot, out Arrival at, out Outcome outcome) {
    Path path = start_in(slot), start = path;
    Hit hit;
    outcome = Outcome(0u, 0.0, 0.0, 0.0);
    if (!POINT_SPECTRUM) band_w = band_powers(power_row(path), path.band);

    float border = -1.0;
    bool met = BAND_CUTS ? meet_with_band(path, hit, border)
                         : intersect_closest(path.position, path.direction, FAR_DISTANCE, path.origin, hit);
    if (LOOPS_MAY_END) {
        // llvmpipe ends every loop of an invocation once they have run 65,535 rounds together, and goes on with what
        // there is.
        uint rounds = 0u;
        while (rounds < 2u) rounds += min(p.lattices, 1u);
        if (rounds < 2u) {
            outcome = Outcome(LOST_NUMERIC, carried_w(path), 0.0, 0.0);
            return ENDED;
        }
    }
    // Looked up once for all branches; some object and facet where nothing was met.
    Object thing = object_at(met ? hit.object : 0u);
    Triangle facet = hit_triangle(hit);
    uint kind = met ? thing.kind : NONE;

    if (FLIGHTS) flight = flight_of(path, met ? hit.distance : FAR_DISTANCE);
    if (ABSORPTION && met) absorb(path, hit.distance, outcome.absorbed_w);
    if (met) path.position = surface_point(hit, facet, path.position, path.direction);
    if (FOOTPRINTS && path.depth > 0u) keep_directions_within(path);
    if (LAMP_COLUMNS && met && path.depth > 0u && ARE_BOUNDED) keep_pair_above(path, LAMP, hit.normal_g);
    if (LOBE_COLUMNS && met && ARE_BOUNDED) keep_pair_above(path, LOBE, hit.normal_g);
    transfer_columns(path, hit.normal_g, hit.distance);
    if (FOOTPRINTS && (IS_GLASS(kind) || kind == KIND_MIRROR))
        keep_columns_within(path, start, thing.colour.z, hit.distance);

    at = Arrival(path, start, hit, facet, thing, kind, border);
    if (BEAMS && met && (path.walk.light_and_source >> 16) == 0xffffu && is_beam_object(hit.object)) {
        outcome = Outcome(LEFT_TO_BEAMS, carried_w(path), 0.0, 0.0);
        return ENDED;
    }
    return kind == KIND_DIFFUSE && border < 0.0 ? LANDS : GOES_ON;
}

// What becomes of a ray that does not land; `k` says where its children go.
void go_past(Arrival at, uint k, inout Outcome outcome) {
    if (at.kind == KIND_BLACK && at.border < 0.0) {
        outcome.what |= ABSORBED;
        outcome.flux_w = carried_w(at.path);
    } else if (at.kind == NONE) {
        // A ray that leaves the scene from inside a solid slipped through a crack.
        outcome.what |= is_inside(at.path.medium) ? LOST_NUMERIC : ESCAPED;
        outcome.flux_w = carried_w(at.path);
    } else if (at.path.depth >= most_depth() && at.border < 0.0) {
        outcome.what |= LOST_DEPTH;
        outcome.flux_w = carried_w(at.path);
    } else {
        scatter(at.path, at.start, at.hit, at.facet, at.kind, at.thing, at.border, k, outcome);
    }
}

void note_flight(Arrival at, uint k, Outcome outcome) {
    // The parts of a band that is cut fly again.
    if (BAND_CUTS && (outcome.what & FELL_BAND) != 0u) flight.flux_w = 0.0;
    flight.what |= at.kind == KIND_DIFFUSE || at.kind == KIND_BLACK || at.kind == NONE ? 0u : 1u;
#ifndef RAY_POOL
    store_flight(state.flights - state.alive + k, flight);
#else
    if (outcome.what != WAITS) store_flight(atomicAdd(state.flights, 1u), flight);
#endif
}

// An event of the ray in `slot`; `k` says where what it leaves goes.
void follow(uint slot, uint k, out Outcome outcome) {
    Arrival at;
    uint comes_to = arrive(slot, at, outcome);
    if (comes_to == LANDS)
        land(at, k, outcome);
    else if (comes_to == GOES_ON)
        go_past(at, k, outcome);
    if (FLIGHTS) note_flight(at, k, outcome);
}

void main() {
    uint k = gl_GlobalInvocationID.x;
    Outcome outcome;
#ifndef RAY_POOL
    if (k >= state.alive) return;
    follow(indices[k], k, outcome);
    store_outcome(k, outcome);
#else
    open_tally();
    find_ray(k);
    do {
        if (ray_goes_on) ray_goes_on = load_path(ray_slot).depth != NONE;
        bool lands = false, waits = false;
        for (uint event = 0u; (event < events || ends_all) && ray_goes_on && !waits; ++event) {
            ray_goes_on = false;
            second_slot = ray_slot;
            follow(ray_slot, ray_slot, outcome);
            lands = (outcome.what & LEFT_PHOTON) != 0u;
            waits = outcome.what == WAITS;
            if (!waits) {
                count_outcome(outcome);
                ++events_done;
            }
            ray_goes_on = ray_goes_on || waits;
        }
        hand_on_rays(lands);
    } while (find_held());
    if (!FLIGHTS) atomicAdd(group_events, events_done);
    close_group(false);
#endif
}
