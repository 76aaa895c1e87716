// A camera path at a crystal and at a polariser, for camera/meet.glsl. Each lobe is a path of its own; if they are
// weak, one is sampled for all.

#include "path/crystal.glsl"
#include "path/polariser.glsl"

// The path turned into a lobe, which is followed with this probability.
void send_lobe(inout Path path, Hit hit, Event event, CrystalEvent met, uint lobe, float probability) {
    bool onward = (lobe & LOBE_ONWARD) != 0u, entering = dot(path.direction, hit.normal_g) < 0.0, geometric;
    vec3 share = lobe_share(met, lobe) / probability;
    turn_crystal(path, event, met, lobe, geometric);
    path.throughput *= share;
    path.walk.branch_weight *= dot(share, OVER_BAND);
    path.walk.key = hash_combine(path.walk.key, 32u + lobe);
    if (SURFACE_FILTERS && onward) filter_path(path, hit);
    leave_surface(path, hit, onward == entering);
}

// One crystal surface: `path` goes on, other lobes are put on the stack.
void cross_crystal(inout Path path, Hit hit, Event event, uint pixel_key) {
    CrystalEvent met = crystal_event(path, event);
    vec4 lobes = vec4(1.0);
    if (HAS_DISPERSION && path.restricted == 0u) {
        // What is reflected off the outside knows no wavelength but in its strength: it stays whole.
        if (!met.from_crystal && stack_size < STACK) {
            Path mirrored = path;
            send_lobe(mirrored, hit, event, met, 0u, 1.0);
            push(mirrored);
            lobes.x = 0.0;
        }
        restrict_to_band(path, pixel_key);
        met = crystal_event(path, event);
    }
    vec4 likely = lobes * (met.shares * OVER_BAND);
    uint kept = strongest_lobe(likely);
    float all = dot(likely, vec4(1.0)), least = min(all - likely[kept], likely[kept]);
    if (all <= 0.0) {
        path.walk.inverse_pdf = 0.0;
        return;
    }
    bool strong = least > 0.0
        && (path.depth <= 1u || path.walk.branch_weight * least > max(p.split_threshold, MIN_ORDER_SHARE)),
         splits = strong && stack_size + LOBES - 1 <= STACK;
    if (strong && !splits) atomicAdd(fallbacks[FELL_STACK], 1u);
    if (!splits) kept = chosen_lobe(likely, choice(path, pixel_key) * all);
    for (uint lobe = 0u; splits && lobe < uint(LOBES); ++lobe) {
        if (lobe == kept || likely[lobe] <= 0.0) continue;
        Path part = path;
        send_lobe(part, hit, event, met, lobe, 1.0);
        push(part);
    }
    send_lobe(path, hit, event, met, kept, splits ? 1.0 : likely[kept] / all);
}

void cross_polariser(inout Path path, Hit hit, uint texel, uint pixel_key) {
    bool entering = dot(path.direction, hit.normal_g) < 0.0;
    Crystal sheet = crystal_at(texel);
    if (HAS_DISPERSION && path.restricted == 0u && sheet.retardance_um != 0.0) restrict_to_band(path, pixel_key);
    vec3 share = pass_polariser(path, sheet);
    path.throughput *= share;
    path.walk.branch_weight *= dot(share, OVER_BAND);
    if (all(lessThanEqual(share, vec3(0.0)))) path.walk.inverse_pdf = 0.0;
    leave_surface(path, hit, entering);
}
