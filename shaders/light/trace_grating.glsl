// A photon's path at a grating, for `trace.comp`.
#include "path/grating.glsl"

// A grating of up to so many orders sends each on as a whole lattice where it is met first.
#define MAX_WHOLE_ORDERS 3u

// What the orders before `number` leave of a path's light, over x.
vec3 left_by_orders(GratingEvent met, uint number, Path path, vec3 x, bool single) {
    vec3 left = vec3(order_at(met.row, number).left);
    if (GRATING_PROFILES && met.grating.profile != 0u) {
        left = vec3(1.0);
        for (uint k = 0u; k < number; ++k) left -= order_shares(met, order_at(met.row, k), k, path, x, single);
    }
    return max(left, 0.0);
}

// Shares of the light of a path that comes to the orders from `first` on: of order `number`, `own`; and for those
// behind it, or with it where the band is `cut`, `left`.
void shares_from(
    GratingEvent met, uint first, uint number, Path path, vec3 x, bool single, bool cut, out vec3 own, out vec3 left) {
    vec3 per_left = 1.0 / max(left_by_orders(met, first, path, x, single), 1e-9);
    own = order_shares(met, order_at(met.row, number), number, path, x, single) * per_left;
    left = left_by_orders(met, number, path, x, single) * per_left;
    if (!cut) left = number + 1u < met.grating.orders ? max(left - own, 0.0) : vec3(0.0);
}

// Share of a path's power, by which roulette judges, where it keeps these shares of its band and of its companions.
float share_of_power(Path path, vec3 share, vec3 companions) {
    if (!GRATING_PROFILES) return share.y;
    Path some = path;
    weaken(some, share, companions);
    return common_share(path, carried_w(some) / max(carried_w(path), 1e-30), companions);
}

// A grating's orders leave one after the other. The first one that carries light goes on as `child`; for the others the
// path meets the surface again (`rest`, the path before its flight). `rest` is also the other part of a band that is
// cut because this order becomes evanescent inside it. Whether `child` lives.
bool diffract(Path path, Hit hit, Event event, uint row, out Path child, inout Path rest, out bool rest_lives,
    inout Outcome outcome) {
    GratingEvent met = grating_event(path, event.frame.normal, hit, row);
    uint orders = met.grating.orders, first = min(path.order, orders - 1u), number = first;
    child = child_of(path, hit, dot(path.direction, hit.normal_g) >= 0.0);
    GratingOrder order;
    bvec3 passes = bvec3(false);
    float at = -1.0;
    rest_lives = false;
    for (; number < orders; ++number) {
        order = order_drawn(met, number, path.walk.photon_id / p.lattices, path.depth,
            hash_combine(p.surface_key, path.walk.photon_id % p.lattices));
        passes = order_passes(met, order, path);
        if (BAND_CUTS) {
            bool is_final = path.recut != 0u && number == first;
            if (any(passes) && !all(passes) && !is_final && path.band.z - path.band.x > MIN_CUT_BAND)
                at = clear_cut(path, rest, evanescence_in_band(met, order, path, passes), hit.distance);
        }
        if (passes.y || at >= 0.0) break;
    }
    bool found = number < orders, cut = at >= 0.0;
    vec3 own = vec3(0.0), left = own;
    if (found) shares_from(met, first, number, path, path.band, false, cut, own, left);
    vec3 companions = own, left_companions = left;
    if (HERO && GRATING_PROFILES && found)
        shares_from(met, first, number, path, path.walk.companion_x.xyz, true, cut, companions, left_companions);
    float kept = share_of_power(path, left, left_companions), share = share_of_power(path, own, companions);
    outcome.what |= ABSORBED;
    outcome.flux_w = carried_w(path) * max(1.0 - kept - (cut ? 0.0 : share), 0.0);
    outcome.absorbed_w *= 1.0 - kept;
    weaken(rest, left, left_companions);
    rest.walk.survival *= kept;
    rest.recut = 0u;
    rest.order = cut ? number : number + 1u;
    rest_lives = kept > 0.0;
    if (BAND_CUTS && cut) {
        outcome.what |= FELL_BAND;
        float below = power_below(rest, at);
        child = part_of_band(rest, rest.band.x, at, below, 5u);
        rest = part_of_band(rest, at, rest.band.z, 1.0 - below, 6u);
        return rest_lives;
    }
    if (share <= 0.0) return false;
    bool geometric;
    if (!is_reflective(met.grating)) child.origin.inside ^= 1u;
    diffract_path(child, event, met, order, geometric);
    if (HERO && POLARISED)
        keep_companions(
            child, behind_grating(companions_of(path), path.direction, child.direction, is_reflective(met.grating)));
    weaken(child, own, companions);
    if (order.shift_per_um != 0.0) leave_companions(child);
    // Neighbours on the lattice have gone elsewhere.
    if (LINE_WIDTHS && met.grating.spread_per_um > 0.0) child.walk.flags |= FLAG_OFF_LATTICE;
    outcome.what |= geometric ? FELL_NORMAL : 0u;
    return survives(child, outcome.roulette_w, share, 16u + number, child.depth == 1u && orders <= MAX_WHOLE_ORDERS);
}
