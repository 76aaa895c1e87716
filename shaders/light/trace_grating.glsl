// A photon's path at a grating, for `trace.comp`.
#include "path/grating.glsl"

// A grating of up to so many orders sends each on as a whole lattice where it is met first.
#define MAX_WHOLE_ORDERS 3u

// A grating's orders leave one after the other. The first one that carries light goes on as `child`; for the others the
// path meets the surface again
// (`rest`, the path before its flight). `rest` is also the other part of a band that is cut because this order becomes
// evanescent inside it. Whether `child` lives.
bool diffract(Path path, Hit hit, Event event, uint row, out Path child, inout Path rest, out bool rest_lives,
    inout Outcome outcome) {
    GratingEvent met = grating_event(path, event, hit, row);
    uint orders = met.grating.orders, first = min(path.order, orders - 1u), number = first;
    child = child_of(path, hit, dot(path.direction, hit.normal_g) >= 0.0);
    GratingOrder order;
    vec3 steps;
    bvec3 passes = bvec3(false);
    float at = -1.0;
    rest_lives = false;
    for (; number < orders; ++number) {
        order = order_at(row, number);
        steps = order_steps(order, hit.object, met.medium, path.band);
        passes = order_passes(path, event, met, steps);
        if (BAND_CUTS) {
            bool is_final = path.recut != 0u && number == first;
            if (any(passes) && !all(passes) && !is_final && path.band.z - path.band.x > MIN_CUT_BAND)
                at = clear_cut(path, rest, evanescence_in_band(path, event, met, order, passes), hit.distance);
        }
        if (passes.y || at >= 0.0) break;
    }
    // Of the light that is here, what the orders from `first` on have left when this one, and the next one, has its
    // turn.
    float per_left = 1.0 / max(order_at(row, first).left, 1e-9);
    bool found = number < orders, more = found && number + 1u < orders;
    float kept = found ? order.left * per_left : 0.0, share = found ? order.efficiency * per_left : 0.0;
    float left = at >= 0.0 ? kept : (more ? kept - share : 0.0);
    outcome.what |= ABSORBED;
    outcome.flux_w = carried_w(path) * max(1.0 - left - (at >= 0.0 ? 0.0 : share), 0.0);
    outcome.absorbed_w *= 1.0 - left;
    weaken(rest, vec3(left), vec3(left));
    rest.walk.survival *= left;
    rest.recut = 0u;
    rest.order = at >= 0.0 ? number : number + 1u;
    rest_lives = left > 0.0;
    if (BAND_CUTS && at >= 0.0) {
        outcome.what |= FELL_BAND;
        float below = power_below(rest, at);
        child = part_of_band(rest, rest.band.x, at, below, 5u);
        rest = part_of_band(rest, at, rest.band.z, 1.0 - below, 6u);
        return rest_lives;
    }
    if (share <= 0.0) return false;
    bool geometric;
    if (order.reflects == 0u) child.origin.inside ^= 1u;
    diffract_path(child, event, met, order, steps, geometric);
    if (HERO && POLARISED) {
        keep_companions(
            child, behind_grating(companions_of(path), path.direction, child.direction, order.reflects != 0u));
    }
    weaken(child, vec3(share), vec3(share));
    if (steps.y != 0.0) leave_companions(child);
    outcome.what |= geometric ? FELL_NORMAL : 0u;
    return survives(child, outcome.roulette_w, share, 16u + number, child.depth == 1u && orders <= MAX_WHOLE_ORDERS);
}
