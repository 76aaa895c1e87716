// A camera path at a diffraction grating, for camera/meet.glsl. Each order is a path of its own: the first that exists
// is followed, a copy on the stack meets the grating again for the rest. If they are weak, one is sampled for all.

#include "path/grating.glsl"

// Flag in `Path.order`: of all orders the path has only this one to follow.
#define ONLY_ORDER 0x80000000u
// Share of a sample's power below which one order is sampled instead: following many orders at several gratings would
// exceed the sample's limit of events.
#define MIN_ORDER_SHARE 0.02

// Shares of order `k` of a path that has not chosen one yet.
vec3 order_shares(GratingEvent met, uint k, Path path) {
    return order_shares(met, order_at(met.row, k), k, path, path.band, false);
}

// How likely an order is chosen, in proportion: none that carries light at some wavelength is left out.
float order_odds(GratingEvent met, uint k, Path path) {
    vec3 shares = order_shares(met, k, path);
    if (GRATING_PROFILES && met.grating.profile != 0u)
        return dot(shares, OVER_BAND) + 0.02 * order_at(met.row, k).efficiency;
    return shares.y;
}

// Samples one of the orders from `first` on in proportion to what they leave; its path then represents all of them.
uint chosen_order(inout Path path, GratingEvent met, uint first, uint count, uint pixel_key) {
    float all = 0.0;
    for (uint k = first; k < count; ++k) all += order_odds(met, k, path);
    float draw = choice(path, pixel_key) * all, below = 0.0;
    uint chosen = first;
    for (uint k = first; k < count; ++k) {
        if (below <= draw) chosen = k;
        below += order_odds(met, k, path);
    }
    path.walk.inverse_pdf *= all / max(order_odds(met, chosen, path), 1e-9);
    return chosen;
}

// Summed shares of the orders a path has yet to follow at the grating ahead: of its light if it ends there.
vec3 shares_left(Path path, Hit hit) {
    vec3 normal = dot(path.direction, hit.normal_g) < 0.0 ? hit.normal_g : -hit.normal_g;
    GratingEvent met = grating_event(path, normal, hit, object_at(hit.object).weight_row);
    uint first = path.order & ~ONLY_ORDER;
    uint end = (path.order & ONLY_ORDER) != 0u ? first + 1u : met.grating.orders;
    vec3 left = vec3(0.0);
    for (uint k = first; k < end; ++k) left += order_shares(met, k, path);
    return left;
}

// The event at a grating. `whole`: the path before its flight to here. A path that ends gets `inverse_pdf` 0.
void meet_grating(inout Path path, Path whole, Hit hit, Event event, uint pixel_key) {
    uint row = object_at(hit.object).weight_row;
    GratingEvent met = grating_event(path, event.frame.normal, hit, row);
    bool alone = (path.order & ONLY_ORDER) != 0u, geometric;
    uint number = path.order & ~ONLY_ORDER, orders = met.grating.orders;
    if (!alone && number + 1u < orders) {
        bool strong = path.depth <= 1u
            || path.walk.branch_weight * order_odds(met, number, whole) > max(p.split_threshold, MIN_ORDER_SHARE);
        if (strong && stack_size >= STACK) atomicAdd(fallbacks[FELL_STACK], 1u);
        if (!strong || stack_size >= STACK) {
            number = chosen_order(whole, met, number, orders, pixel_key);
            path.walk.inverse_pdf = whole.walk.inverse_pdf;
            alone = true;
        }
    }
    // Orders that deflect by wavelength go on as one band of the spectrum; the zeroth keeps the whole spectrum.
    Path banded = path;
    if (HAS_DISPERSION && banded.restricted == 0u) restrict_to_band(banded, pixel_key);
    uint end = alone ? number + 1u : orders;
    GratingOrder order;
    bvec3 passes = bvec3(false);
    for (; number < end; ++number) {
        order = order_drawn(met, number, p.sample_index, path.depth, hash_combine(pixel_key, 90u));
        passes = order_passes(met, order, banded);
        if (any(passes) && order.efficiency > 0.0) break;
    }
    if (number >= end) {
        path.walk.inverse_pdf = 0.0;
        return;
    }
    bool more = !alone && number + 1u < end, here = passes.y, cut = false;
    if (SPECTRAL_SWEEP) {
        if (!all(passes) && path.recut == 0u) {
            float at = cell_border(evanescence_in_band(met, order, banded, passes));
            Path start = start_of_band(whole, banded);
            cut = may_cut_near(start, at, hit.distance);
            if (cut) {
                // Both parts of the cut band meet this surface again, each from its own start. With orders pending,
                // this order first meets the surface again on its own, and is cut then.
                path = more ? whole : start;
                path.recut = uint(!more);
                cut_at = more ? -1.0 : at;
            }
        }
        here = here || cut;
    }
    if (more) {
        Path rest = whole;
        rest.order = number + 1u;
        rest.recut = 0u;
        push(rest);
    }
    if (cut || !here) {
        path.order = number | ONLY_ORDER;
        if (!here) path.walk.inverse_pdf = 0.0;
        return;
    }
    vec3 shares = order_shares(met, order, number, banded, banded.band, false);
    if (order.shift_per_um != 0.0 || (GRATING_PROFILES && met.grating.profile != 0u)) path = banded;
    path.throughput *= shares;
    path.walk.branch_weight *= dot(shares, OVER_BAND);
    path.walk.key = hash_combine(path.walk.key, 16u + number);
    diffract_path(path, event, met, order, geometric);
    leave_surface(path, hit, dot(path.direction, hit.normal_g) < 0.0);
}
