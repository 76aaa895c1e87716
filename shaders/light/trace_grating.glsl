// A ray in flight at a grating, for `trace.comp`.
#ifdef HAS_GRATING
// A grating's orders leave one after the other. The first one that carries light goes on as `child`; for the others the ray meets the surface
// again (`rest`, the ray before its flight). `rest` is also the other part of a band that is cut because this order becomes evanescent inside
// it. Whether `child` lives.
bool diffract(RayRecord ray, Hit hit, ShadingFrame frame, uint row, inout RayRecord child, inout RayRecord rest, out bool rest_lives, inout Outcome outcome)
{
    Grating grating = grating_at(row);
    uint medium = current_medium(medium_stack(ray)), first = min(ray.flags >> ORDER_BIT, grating.orders - 1u), number = first;
    float side = dot(ray.direction, hit.normal_g) < 0.0 ? 1.0 : -1.0;
    vec3 across = across_lines(frame.normal, grating.lines, side);
    vec3 low = ray.direction, high = ray.direction, steps;
#if SPECTRAL_GROUPS > 0
    vec3 columns[SPECTRAL_GROUPS];
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        columns[g] = ray.ddirection[SPATIAL + g].xyz;
        low += variable_step(uint(g), ray.x_lo, ray.x_anchor) * columns[g];
        high += variable_step(uint(g), ray.x_hi, ray.x_anchor) * columns[g];
    }
    low = normalize(low);
    high = normalize(high);
#endif
    GratingOrder order;
    bvec3 passes = bvec3(false);
    float at = -1.0;
    rest_lives = false;
    for (; number < grating.orders; ++number) {
        order = order_at(row, number);
        steps = order_steps(order, hit.object, medium, band_of(ray));
        vec3 cosine2 = vec3(diffracted_cosine2(low, dot(low, frame.normal), steps.x * across),
            diffracted_cosine2(ray.direction, dot(ray.direction, frame.normal), steps.y * across),
            diffracted_cosine2(high, dot(high, frame.normal), steps.z * across));
        passes = greaterThan(cosine2, vec3(0.0));
#ifdef BAND_CUTS
        bool is_final = (ray.flags & FLAG_BAND_FINAL) != 0u && number == first;
        if (any(passes) && !all(passes) && !is_final && ray.x_hi - ray.x_lo > MIN_CUT_BAND) {
            vec3 bends[2] = vec3[](vec3(0.0), vec3(0.0));
            at = clear_cut(ray, rest, evanescence_onset(band_of(ray), ray.direction, columns, bends, frame.normal, grating.lines, side, order, hit.object, medium, passes), hit.distance);
        }
#endif
        if (passes.y || at >= 0.0) break;
    }
    // Of the light that is here, what the orders from `first` on have left when this one, and the next one, has its turn.
    float per_left = 1.0 / max(order_at(row, first).left, 1e-9);
    bool found = number < grating.orders, more = found && number + 1u < grating.orders;
    float kept = found ? order.left * per_left : 0.0, share = found ? order.efficiency * per_left : 0.0;
    float left = at >= 0.0 ? kept : (more ? kept - share : 0.0);
    outcome.what |= ABSORBED;
    outcome.flux_w = carried_w(ray) * max(1.0 - left - (at >= 0.0 ? 0.0 : share), 0.0);
    outcome.absorbed_w *= 1.0 - left;
    rest.flux_w *= left;
    rest.throughput *= left;
#ifdef HERO
    rest.companion_throughput *= left;
#endif
    rest.survival *= left;
    rest.flags = (rest.flags & ((1u << ORDER_BIT) - 1u) & ~FLAG_BAND_FINAL) | ((at >= 0.0 ? number : number + 1u) << ORDER_BIT);
    rest_lives = left > 0.0;
#ifdef BAND_CUTS
    if (at >= 0.0) {
        outcome.what |= FELL_BAND;
        vec3 power = spectral_row(uint(p.power_row), vec3(rest.x_lo, at, rest.x_hi));
        float below = clamp((power.y - power.x) / max(power.z - power.x, 1e-30), 0.0, 1.0);
        child = part_of_band(rest, rest.x_lo, at, below, 5u);
        rest = part_of_band(rest, at, rest.x_hi, 1.0 - below, 6u);
        return rest_lives;
    }
#endif
    if (share <= 0.0) return false;
    Deflection turned = diffract_at(frame, ray.direction, grating.lines, side, steps.y, order.reflects != 0u);
    if (order.reflects == 0u) child.flags ^= FLAG_INSIDE;
    send_on(child, turned, vec3(share), outcome);
#ifdef POLARISED
    polarise_order(child, ray, order.reflects != 0u);
#endif
#ifdef HERO
    child.companion_throughput *= share;
    if (steps.y != 0.0) leave_companions(child);
#endif
#if COLUMNS > 0
    for (int c = 0; c < COLUMNS; ++c) {
        float dstep = 0.0;
#if SPECTRAL_GROUPS > 0
        if (c >= SPATIAL && c < LOBE) dstep = order_step_derivative(order, hit.object, medium, uint(c - SPATIAL), ray.x_anchor);
#endif
        child.ddirection[c].xyz = diffracted_column(turned, ray.direction, ray.ddirection[c].xyz, NORMAL_COLUMN(c), grating.lines, side, steps.y, dstep, order.reflects != 0u);
    }
#endif
    return survives(child, outcome.roulette_w, share, 16u + number, child.depth == 1u && grating.orders <= MAX_WHOLE_ORDERS);
}
#endif
