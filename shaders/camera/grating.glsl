// What a grating does to a camera path. The grating equation is the same backwards, and the directions' parts in the surface are only moved by
// it: radiance is handed on by the efficiency alone. Every order is a path of its own: one goes on, the others meet the surface again after
// it; of weak ones one is chosen by chance.
#ifndef CAMERA_GRATING_GLSL
#define CAMERA_GRATING_GLSL

#include "lib/grating.glsl"

// On `CameraPath.order`: only that order is left.
#define ONLY_ORDER 0x80000000u
// Share of a sample's power below which orders are not all followed: many orders at several gratings would use up its events.
#define MIN_ORDER_SHARE 0.02

void diffract_path(inout CameraPath path, PathFrame frame, Grating grating, GratingOrder order, uint object, float side, vec3 steps)
{
    bool reflects = order.reflects != 0u;
    Deflection turned = diffract_at(frame.shading, path.direction, grating.lines, side, steps.y, reflects);
#ifdef SPECTRAL_SWEEP
    for (int end = 0; end < 2; ++end) {
        vec3 normal = turned.geometric ? turned.normal : frame.end_normal[end], direction = path.end_direction[end];
        vec3 shift = (end == 0 ? steps.x : steps.z) * across_lines(normal, grating.lines, side);
        float theta = dot(direction, normal), cosine2 = diffracted_cosine2(direction, theta, shift);
        vec3 turned_end = diffract_direction(direction, normal, theta, shift, sqrt(max(cosine2, 1e-12)), reflects);
        path.end_direction[end] = normalize(turned_end);
    }
#endif
    for (int c = 0; c < COLUMNS_HELD; ++c) {
        float dstep = 0.0;
#if SPECTRAL_GROUPS > 0
        if (c >= SPATIAL && c < SPATIAL + SPECTRAL_GROUPS) dstep = order_step_derivative(order, object, current_medium(path.medium), uint(c - SPATIAL), path.band.y);
#endif
        path.ddirection[c] = diffracted_column(turned, path.direction, path.ddirection[c], NORMAL_COLUMN(frame, c), grating.lines, side, steps.y, dstep, reflects);
    }
    path.direction = turned.direction;
}

// Of the orders from `first` on one, by chance as they are strong: the path stands for all of them then.
uint chosen_order(inout CameraPath path, uint row, uint first, uint count, uint pixel_key)
{
    float all = 0.0;
    for (uint k = first; k < count; ++k) all += order_at(row, k).efficiency;
    float draw = choice(path, pixel_key) * all, below = 0.0;
    uint chosen = first;
    for (uint k = first; k < count; ++k) {
        if (below <= draw) chosen = k;
        below += order_at(row, k).efficiency;
    }
    path.inverse_pdf *= all / max(order_at(row, chosen).efficiency, 1e-9);
    return chosen;
}

// What a path stands for that has not met the grating ahead yet, or not with all its orders.
float efficiency_left(CameraPath path, uint object)
{
    uint row = object_at(object).weight_row, first = path.order & ~ONLY_ORDER;
    uint end = (path.order & ONLY_ORDER) != 0u ? first + 1u : grating_at(row).orders;
    float left = 0.0;
    for (uint k = first; k < end; ++k) left += order_at(row, k).efficiency;
    return left;
}

// `whole`: the path before its flight here. A path that ends has an inverse probability of 0.
void meet_grating(inout CameraPath path, CameraPath whole, Hit hit, Triangle facet, uint pixel_key)
{
    uint row = object_at(hit.object).weight_row, medium = current_medium(path.medium);
    Grating grating = grating_at(row);
    PathFrame frame = path_frame(path, hit, facet);
    vec3 normal = frame.shading.normal;
    float side = dot(path.direction, hit.normal_g) < 0.0 ? 1.0 : -1.0;
    bool alone = (path.order & ONLY_ORDER) != 0u;
    uint number = path.order & ~ONLY_ORDER;
    if (!alone && number + 1u < grating.orders) {
        bool strong = path.depth <= 1 || path.branch_weight * order_at(row, number).efficiency > max(p.split_threshold, MIN_ORDER_SHARE);
        if (strong && stack_size >= STACK) atomicAdd(fallbacks[FELL_STACK], 1u);
        if (!strong || stack_size >= STACK) {
            number = chosen_order(whole, row, number, grating.orders, pixel_key);
            path.inverse_pdf = whole.inverse_pdf;
            alone = true;
        }
    }
    // What is thrown to the side is one band; what goes straight on or back stays whole.
    CameraPath banded = path;
#ifdef HAS_DISPERSION
    if (banded.restricted == 0u) restrict_to_band(banded, pixel_key);
#endif
    uint end = alone ? number + 1u : grating.orders;
    GratingOrder order;
    vec3 steps;
    bvec3 passes = bvec3(false);
    for (; number < end; ++number) {
        order = order_at(row, number);
        steps = order_steps(order, hit.object, medium, banded.band);
        vec3 across = across_lines(normal, grating.lines, side);
        passes = bvec3(diffracted_cosine2(banded.direction, dot(banded.direction, normal), steps.y * across) > 0.0);
#ifdef SPECTRAL_SWEEP
        passes.x = diffracted_cosine2(banded.end_direction[0], dot(banded.end_direction[0], normal), steps.x * across) > 0.0;
        passes.z = diffracted_cosine2(banded.end_direction[1], dot(banded.end_direction[1], normal), steps.z * across) > 0.0;
#endif
        if (any(passes) && order.efficiency > 0.0) break;
    }
    if (number >= end) {
        path.inverse_pdf = 0.0;
        return;
    }
    bool more = !alone && number + 1u < end, here = passes.y;
#ifdef SPECTRAL_SWEEP
    bool cut = false;
    if (!all(passes) && path.recut == 0u) {
        vec3 columns[SPECTRAL_GROUPS], bends[2], unused;
        for (int e = 0; e < 2; ++e) {
            linear_end(banded, e, unused, bends[e]);
            bends[e] = banded.end_direction[e] - bends[e];
        }
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) columns[g] = banded.ddirection[SPATIAL + g];
        float at = cell_border(evanescence_onset(banded.band, banded.direction, columns, bends, normal, grating.lines, side, order, hit.object, medium, passes));
        CameraPath start = whole;
        if (start.restricted == 0u) restrict_to_band(start, pixel_key);
        cut = may_cut_at(start, at);
        bool near = cut && (whole.planar_so_far != 0u || cut_is_near(start, at, hit.distance));
        if (cut && !near) atomicAdd(fallbacks[FELL_CUT], 1u);
        cut = near;
        if (cut) {
            // Both parts meet this surface again, each from its own start; where other orders are pending, these first.
            path = start;
            path.recut = uint(!more);
            cut_at = more ? -1.0 : at;
        }
    }
    if (cut && more) path = whole;
    here = here || cut;
#else
    bool cut = false;
#endif
    if (more) {
        pending_path = whole;
        pending_path.order = number + 1u;
        pending_path.recut = 0u;
        pushes_path = true;
    }
    if (cut || !here) {
        path.order = number | ONLY_ORDER;
        if (!here) path.inverse_pdf = 0.0;
        return;
    }
    if (order.shift_per_um != 0.0) path = banded;
    path.weight *= order.efficiency;
    path.branch_weight *= order.efficiency;
    path.key = hash_combine(path.key, 16u + number);
    path.order = 0u;
    path.recut = 0u;
#ifdef POLARISED
    vec3 before = path.direction;
#endif
    diffract_path(path, frame, grating, order, hit.object, side, steps);
#ifdef POLARISED
    path.polarisation = behind_grating(path.polarisation, before, path.direction, order.reflects != 0u);
#endif
    path.origin = RayOrigin(hit.primitive, hit.object, uint(dot(path.direction, hit.normal_g) < 0.0), path.origin.inside_mask);
}

#endif
