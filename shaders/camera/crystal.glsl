// A camera path at a crystal and at a polariser, for camera/meet.glsl. Each lobe is a path of its own; if they are
// weak, one is sampled for all.

#include "path/crystal.glsl"
#if HAS_POLARISER
#include "path/polariser.glsl"
#endif

// The path turned into a lobe, of which it has `share` of its light over its band.
void send_lobe(inout Path path, Hit hit, Event event, CrystalEvent met, uint lobe, vec3 share) {
    bool onward = (lobe & LOBE_ONWARD) != 0u, entering = dot(path.direction, hit.normal_g) < 0.0, geometric;
    turn_crystal(path, event, met, lobe, geometric);
    path.throughput *= share;
    path.walk.key = hash_combine(path.walk.key, 32u + lobe);
    if (SURFACE_FILTERS && onward) {
        vec4 passed = object_colours[hit.object];
        add_length(path, int(passed.x), 1.0);
        path.walk.branch_weight *= passed.y;
    }
    leave_surface(path, hit, onward == entering);
}

// One crystal surface: `path` goes on, other lobes are put on the stack.
void cross_crystal(inout Path path, Hit hit, Event event, uint pixel_key) {
    const vec3 over_band = vec3(0.25, 0.5, 0.25);
    uint first = 0u;
    if (HAS_DISPERSION && path.restricted == 0u) {
        // What is reflected off the outside knows no wavelength but in its strength: it stays whole. What goes on is
        // one band.
        Path mirrored = path;
        restrict_to_band(path, pixel_key);
        if (crystal_of(event.boundary.before) == NONE && stack_size < STACK) {
            CrystalEvent whole = crystal_event(mirrored, event);
            vec3 share = lobe_share(whole, 0u);
            first = 1u;
            if (share.y > 0.0) {
                mirrored.walk.branch_weight *= dot(share, over_band);
                send_lobe(mirrored, hit, event, whole, 0u, share);
                push(mirrored);
            }
        }
    }
    CrystalEvent met = crystal_event(path, event);
    float all = 0.0, strongest = 0.0;
    uint kept = first, count = 0u;
    for (uint lobe = first; lobe < MOST_LOBES; ++lobe) {
        float share = dot(lobe_share(met, lobe), over_band);
        all += share;
        count += uint(share > 0.0);
        kept = share > strongest ? lobe : kept;
        strongest = max(strongest, share);
    }
    if (all <= 0.0) {
        path.walk.inverse_pdf = 0.0;
        return;
    }
    bool strong =
        count < 2u || path.depth <= 1u || path.walk.branch_weight * min(all - strongest, strongest) > p.split_threshold;
    bool splits = strong && stack_size + int(count) <= STACK + 1;
    if (strong && !splits) atomicAdd(fallbacks[FELL_STACK], 1u);
    if (splits) {
        for (uint lobe = first; lobe < MOST_LOBES; ++lobe) {
            vec3 share = lobe_share(met, lobe);
            float likely = dot(share, over_band);
            if (lobe == kept || likely <= 0.0) continue;
            Path part = path;
            part.walk.branch_weight *= likely;
            send_lobe(part, hit, event, met, lobe, share);
            push(part);
        }
        path.walk.branch_weight *= strongest;
        send_lobe(path, hit, event, met, kept, lobe_share(met, kept));
        return;
    }
    float draw = choice(path, pixel_key) * all, below = 0.0;
    for (uint lobe = first; lobe < MOST_LOBES; ++lobe) {
        float share = dot(lobe_share(met, lobe), over_band);
        if (share > 0.0 && below <= draw) kept = lobe;
        below += share;
    }
    vec3 share = lobe_share(met, kept);
    path.walk.branch_weight *= all;
    send_lobe(path, hit, event, met, kept, share * (all / dot(share, over_band)));
}

#if HAS_POLARISER
void cross_polariser(inout Path path, Hit hit, uint texel, uint pixel_key) {
    bool entering = dot(path.direction, hit.normal_g) < 0.0;
    Crystal sheet = crystal_at(texel);
    if (HAS_DISPERSION && path.restricted == 0u && sheet.retardance_um != 0.0) restrict_to_band(path, pixel_key);
    vec3 share = pass_polariser(path, sheet);
    path.throughput *= share;
    path.walk.branch_weight *= dot(share, vec3(0.25, 0.5, 0.25));
    if (all(lessThanEqual(share, vec3(0.0)))) path.walk.inverse_pdf = 0.0;
    leave_surface(path, hit, entering);
}
#endif
