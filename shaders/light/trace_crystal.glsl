// A photon's path at a crystal, for `trace.comp`: its lobes leave one after the other, as a grating's orders do.
// `child` is the first that there is of those yet to come, `rest` the path before its flight for the others. Whether
// `child` lives.
#include "path/crystal.glsl"

bool part_in_crystal(Path path, Hit hit, Event event, uint filter_row, out Path child, inout Path rest,
    out bool rest_lives, inout Outcome outcome) {
    CrystalEvent met = crystal_event(path, event);
    // A lobe that the anchor does not have is none.
    uvec4 lobes = uvec4(0u, 1u, 2u, 3u);
    vec4 ahead = vec4(greaterThanEqual(lobes, uvec4(path.order)));
    uint chosen = chosen_lobe(ahead * met.shares[1], 0.0);
    vec4 behind = vec4(greaterThan(lobes, uvec4(chosen)));
    vec3 per_left = 1.0 / max(ahead * met.shares, 1e-20), share = lobe_share(met, chosen) * per_left,
         after = behind * met.shares * per_left;
    rest_lives = after.y > 0.0;
    bool entering = dot(path.direction, hit.normal_g) < 0.0, onward = (chosen & LOBE_ONWARD) != 0u, geometric;
    child = child_of(path, hit, onward == entering);
    if (share.y <= 0.0) {
        outcome.what |= LOST_NUMERIC;
        outcome.flux_w = carried_w(path);
        return false;
    }
    float whole_w = carried_w(path);
    turn_crystal(child, event, met, chosen, geometric);
    weaken(child, share, share);
    // What is left flies here again.
    outcome.absorbed_w *= clamp(carried_w(child) / max(whole_w, 1e-30), 0.0, 1.0);
    weaken(rest, after, after);
    rest.walk.survival *= after.y;
    rest.recut = 0u;
    rest.order = chosen + 1u;
    float followed = share.y;
    if (SURFACE_FILTERS && onward) filter_by(filter_row, child, followed, outcome);
    leave_companions(child);
    outcome.what |= geometric ? FELL_NORMAL : 0u;
    return survives(child, outcome.roulette_w, followed, 16u + chosen, child.depth == 1u);
}
