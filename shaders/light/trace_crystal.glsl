// A photon's path at a crystal, for `trace.comp`: its lobes leave one after the other, as a grating's orders do. The
// first that there is of those yet to come leaves; for the others the path meets the surface again.
#include "path/crystal.glsl"

void part_in_crystal(Path path, Path start, Hit hit, Event event, uint filter_row, uint slot, inout Outcome outcome) {
    CrystalEvent met = crystal_event(path, event);
    // A lobe that the anchor does not have is none.
    uvec4 lobes = uvec4(0u, 1u, 2u, 3u);
    vec4 ahead = vec4(greaterThanEqual(lobes, uvec4(path.order)));
    uint chosen = chosen_lobe(ahead * met.shares[1], 0.0);
    vec4 behind = vec4(greaterThan(lobes, uvec4(chosen)));
    vec3 per_left = 1.0 / max(ahead * met.shares, 1e-20), share = lobe_share(met, chosen) * per_left,
         after = behind * met.shares * per_left;
    bool entering = dot(path.direction, hit.normal_g) < 0.0, onward = (chosen & LOBE_ONWARD) != 0u, geometric;
    float whole_w = carried_w(path), followed = share.y;
    if (followed <= 0.0) {
        outcome.what |= LOST_NUMERIC;
        outcome.flux_w = whole_w;
        return;
    }
    path = child_of(path, hit, onward == entering);
    turn_crystal(path, event, met, chosen, geometric);
    weaken(path, share, share);
    // What is left flies here again.
    outcome.absorbed_w *= clamp(carried_w(path) / max(whole_w, 1e-30), 0.0, 1.0);
    if (SURFACE_FILTERS && onward) filter_by(filter_row, path, followed, outcome);
    leave_companions(path);
    outcome.what |= geometric ? FELL_NORMAL : 0u;
    if (survives(path, outcome.roulette_w, followed, 16u + chosen, path.depth == 1u)) {
        uint place = first_place(slot, after.y > 0.0, false);
        if (RAY_POOL && place == NONE) {
            outcome.what = WAITS;
            return;
        }
        store_path(place, path);
        outcome.what |= LEFT_FIRST;
    }
    if (after.y > 0.0) {
        path = START(start, slot);
        weaken(path, after, after);
        path.walk.survival *= after.y;
        path.recut = 0u;
        path.order = chosen + 1u;
        store_path(second_place(slot), path);
        outcome.what |= LEFT_SECOND;
    }
}
