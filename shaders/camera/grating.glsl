// A camera path at a grating. Every order is a path of its own: one goes on, the others meet the surface again after
// it; of weak ones one is chosen by chance.
#ifndef CAMERA_GRATING_GLSL
#define CAMERA_GRATING_GLSL

#include "path/grating.glsl"

// On `Path.order`: only that order is left.
#define ONLY_ORDER 0x80000000u
// Share of a sample's power below which orders are not all followed: many orders at several gratings would use up its
// events.
#define MIN_ORDER_SHARE 0.02

// Of the orders from `first` on one, by chance as they are strong: the path stands for all of them then.
uint chosen_order(inout Path path, uint row, uint first, uint count, uint pixel_key) {
    float all = 0.0;
    for (uint k = first; k < count; ++k) all += order_at(row, k).efficiency;
    float draw = choice(path, pixel_key) * all, below = 0.0;
    uint chosen = first;
    for (uint k = first; k < count; ++k) {
        if (below <= draw) chosen = k;
        below += order_at(row, k).efficiency;
    }
    path.walk.inverse_pdf *= all / max(order_at(row, chosen).efficiency, 1e-9);
    return chosen;
}

// What a path stands for that has not met the grating ahead yet, or not with all its orders.
float efficiency_left(Path path, uint object) {
    uint row = object_at(object).weight_row, first = path.order & ~ONLY_ORDER;
    uint end = (path.order & ONLY_ORDER) != 0u ? first + 1u : grating_at(row).orders;
    float left = 0.0;
    for (uint k = first; k < end; ++k) left += order_at(row, k).efficiency;
    return left;
}

// `whole`: the path before its flight here. A path that ends has an inverse probability of 0.
void meet_grating(inout Path path, Path whole, Hit hit, Event event, uint pixel_key) {
    uint row = object_at(hit.object).weight_row;
    GratingEvent met = grating_event(path, event, hit, row);
    bool alone = (path.order & ONLY_ORDER) != 0u, geometric;
    uint number = path.order & ~ONLY_ORDER, orders = met.grating.orders;
    if (!alone && number + 1u < orders) {
        bool strong = path.depth <= 1u
            || path.walk.branch_weight * order_at(row, number).efficiency > max(p.split_threshold, MIN_ORDER_SHARE);
        if (strong && stack_size >= STACK) atomicAdd(fallbacks[FELL_STACK], 1u);
        if (!strong || stack_size >= STACK) {
            number = chosen_order(whole, row, number, orders, pixel_key);
            path.walk.inverse_pdf = whole.walk.inverse_pdf;
            alone = true;
        }
    }
    // What is thrown to the side is one band; what goes straight on or back stays whole.
    Path banded = path;
    if (HAS_DISPERSION) {
        if (banded.restricted == 0u) restrict_to_band(banded, pixel_key);
    }
    uint end = alone ? number + 1u : orders;
    GratingOrder order;
    vec3 steps;
    bvec3 passes = bvec3(false);
    for (; number < end; ++number) {
        order = order_at(row, number);
        steps = order_steps(order, hit.object, met.medium, banded.band);
        passes = order_passes(banded, event, met, steps);
        if (any(passes) && order.efficiency > 0.0) break;
    }
    if (number >= end) {
        path.walk.inverse_pdf = 0.0;
        return;
    }
    bool more = !alone && number + 1u < end, here = passes.y, cut = false;
    if (SPECTRAL_SWEEP) {
        if (!all(passes) && path.recut == 0u) {
            float at = cell_border(evanescence_in_band(banded, event, met, order, passes));
            Path start = whole;
            if (start.restricted == 0u) restrict_to_band(start, pixel_key);
            cut = may_cut_near(start, at, hit.distance);
            if (cut) {
                // Both parts meet this surface again, each from its own start; where other orders are pending, these
                // first.
                path = more ? whole : start;
                path.recut = uint(!more);
                cut_at = more ? -1.0 : at;
            }
        }
        here = here || cut;
    }
    if (more) {
        pending_path = whole;
        pending_path.order = number + 1u;
        pending_path.recut = 0u;
        pushes_path = true;
    }
    if (cut || !here) {
        path.order = number | ONLY_ORDER;
        if (!here) path.walk.inverse_pdf = 0.0;
        return;
    }
    if (order.shift_per_um != 0.0) path = banded;
    path.throughput *= order.efficiency;
    path.walk.branch_weight *= order.efficiency;
    path.walk.key = hash_combine(path.walk.key, 16u + number);
    diffract_path(path, event, met, order, steps, geometric);
    leave_surface(path, hit, dot(path.direction, hit.normal_g) < 0.0);
}

#endif
