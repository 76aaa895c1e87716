// Which lobes of a surface a photon's path follows, and which parts of a band that is cut before it lands, for
// `trace.comp`. A path that goes on from what it has hit, on that object's inner side or not.
Path child_of(Path path, Hit hit, bool inside) {
    leave_surface(path, hit, inside);
    path.depth += 1u;
    return path;
}

// Which microfacet of a ground surface a path meets: neighbours on its lattice meet other ones.
MicrofacetDraw microfacet_draw(Path path) {
    uint sub = path.walk.photon_id % p.lattices;
    return MicrofacetDraw(path.walk.photon_id / p.lattices, path.depth,
        hash_combine(p.lattice_bits != 0u ? p.surface_key : path.walk.branch_key, sub));
}

// Whether a surface keeps what no lobe of it has in the end.
bool keeps_light(Event event) { return (ROUGH_SURFACES && event.ground.width > 0.0) || (HAS_FILM && FILM_MET(event)); }

// Leaves a path that has been turned its share of the power, over its band, and what microfacets do not hide of it;
// `share`: of the power, by which roulette judges. A microfacet's shadow is no fall-back.
void send_on(inout Path child, Event event, vec3 share_over_band, vec3 companions, vec3 unhidden, bool geometric,
    inout float share, inout Outcome outcome) {
    weaken(child, share_over_band, companions);
    if (ROUGH_SURFACES && event.ground.width > 0.0) {
        weaken(child, unhidden, vec3(unhidden.y));
        share *= unhidden.y;
        outcome.absorbed_w -= carried_w(child);
        return;
    }
    if (HAS_FILM && FILM_MET(event)) outcome.absorbed_w -= carried_w(child);
    outcome.what |= geometric ? FELL_NORMAL : 0u;
}

// What a surface of glass lets through of what enters; the rest is absorbed.
void filter_by(uint row, inout Path child, inout float share, inout Outcome outcome) {
    if (row == NONE) return;
    vec3 kept = spectral_row(uint(WEIGHT_ROW) + row, child.band),
         companions = companion_row(child, uint(WEIGHT_ROW) + row);
    outcome.absorbed_w += carried_w(child);
    weaken(child, kept, companions);
    outcome.absorbed_w -= carried_w(child);
    share *= common_share(child, kept.y, companions);
}

// Both parts of the band of the ray in `slot`, from where it set out.
void send_parts(uint slot, float at, inout Outcome outcome) {
    uint place = first_place(slot, true, false);
    if (place == NONE) outcome.what = WAITS;
    for (uint i = 0u; i < 2u && place != NONE; ++i) {
        Path ray = start_in(slot);
        float low = power_below(ray, at);
        ray = i == 0u ? part_of_band(ray, ray.band.x, at, low, 5u) : part_of_band(ray, at, ray.band.z, 1.0 - low, 6u);
        store_path(i == 0u ? place : second_place(slot), ray);
    }
}

#include "light/trace_grating.glsl"
#include "light/trace_crystal.glsl"
#include "path/polariser.glsl"

// Each child is stored in one place, whichever event made it: where every branch is executed, every store costs even
// when no path takes it. But a crystal's are stored apart, or all that glass holds would be held beside them. `border`:
// where the band is cut before it lands; negative: nowhere.
void scatter(Path path, Path start, Hit hit, Triangle facet, uint kind, Object thing, float border, uint slot,
    inout Outcome outcome) {
    bool entering = dot(path.direction, hit.normal_g) < 0.0, lives = false, geometric;
    if ((path.walk.light_and_source >> 16) == 0xffffu)
        path.walk.light_and_source = (path.walk.light_and_source & 0xffffu) | (hit.object << 16);
    Event event = meet(path, hit, facet, thing, microfacet_draw(path));
    outcome.what |= event.frame.refused != 0u ? FELL_NORMAL : 0u;
    if (HAS_CRYSTAL && parts_waves(event, kind)) {
        part_in_crystal(path, start, hit, event, thing.texture, slot, outcome);
        return;
    }
    weigh(path, kind, event);
    Path child = child_of(path, hit, !entering);
    vec3 unhidden = reflect_path(child, event, geometric);
    Companions companions = companions_at(path, event, kind);
    if (HAS_MIRROR && kind == KIND_MIRROR) {
        vec3 kept = spectral_row(uint(WEIGHT_ROW) + thing.weight_row, path.band),
             of_companions = companion_row(path, uint(WEIGHT_ROW) + thing.weight_row);
        kept *= event.reflectance;
        of_companions *= companions.reflectance;
        float share = common_share(path, share_of_lobe(event, kept), of_companions);
        outcome.what |= ABSORBED;
        send_on(child, event, kept, of_companions, unhidden, geometric, share, outcome);
        polarise_companions(child, companions, false);
        outcome.flux_w = carried_w(path) - carried_w(child);
        if (keeps_light(event)) outcome.absorbed_w += carried_w(child);  // `send_on` has counted it, too
        lives = survives(child, outcome.roulette_w, share, 3u);
    }
    if (HAS_POLARISER && kind == KIND_POLARISER) {
        child = child_of(path, hit, entering);
        vec3 share = pass_polariser(child, crystal_at(thing.receiver));
        weaken(child, share, share);
        leave_companions(child);
        outcome.what |= ABSORBED;
        outcome.flux_w = carried_w(path) - carried_w(child);
        lives = survives(child, outcome.roulette_w, share.y, 2u);
    }
    Path rest;
    bool rest_lives = false;
    if (HAS_GRATING) rest = START(start, slot);
    if (HAS_GRATING && kind == KIND_GRATING)
        lives = diffract(path, hit, event, thing.weight_row, child, rest, rest_lives, outcome);
    bool splits = HAS_DIELECTRIC && IS_GLASS(kind) && event.boundary.changes;
    vec3 let_through = transmittance_of(event);
    float reflected_share = common_share(path, share_of_lobe(event, event.reflectance), companions.reflectance);
    // Refracted they stay together only where nothing disperses.
    float refracted_share = share_of_lobe(event, let_through);
    if (companions.stay) refracted_share = common_share(path, refracted_share, companions.transmittance);
    float at = -1.0, below = 0.0, onset = -1.0;
    if (BAND_CUTS) at = splits ? cut_of_band(path, start, slot, event, hit.distance, onset) : border;
    if (BAND_CUTS && at >= 0.0) {
        // Back to the start of the flight.
        splits = false;
        outcome.absorbed_w = 0.0;
        outcome.what |= FELL_BAND;
        if (RAY_POOL) {
            send_parts(slot, at, outcome);
            return;
        }
        below = power_below(start, at);
        child = part_of_band(start, start.band.x, at, below, 5u);
        lives = true;
    }
    // A part that was cut here ends at the onset: which side of it that end falls on is rounding.
    bool parts = BAND_CUTS && splits && event.cosine2.y <= 0.0 && onset >= 0.0 && !leaves_sliver(path, onset);
    PassingPart part;
    if (BAND_CUTS && HAS_DIELECTRIC && parts) part = passing_part(path, event, onset);
    if (HAS_DIELECTRIC && splits) {
        // What neither of both parts has in the end, the surface keeps.
        if (keeps_light(event)) outcome.absorbed_w += carried_w(path);
        float share = reflected_share;
        send_on(child, event, event.reflectance, companions.reflectance, unhidden, geometric, share, outcome);
        polarise_companions(child, companions, false);
        lives = reflected_share > 0.0 && survives(child, outcome.roulette_w, share, 1u);
    }
    if (HAS_DIELECTRIC && IS_GLASS(kind) && !event.boundary.changes) {
        // Another solid decides here: walk through, only remember where we are.
        child = path;
        child.medium = event.boundary.behind;
        leave_surface(child, hit, entering);
        lives = true;
    }
    bool refracts = HAS_DIELECTRIC && splits && event.refracted.exists, both = at >= 0.0 || refracts || rest_lives,
         stays = splits && reflected_share > refracted_share;
    if (lives) {
        uint place = first_place(slot, both, stays);
        if (RAY_POOL && place == NONE) {
            outcome.what = WAITS;
            return;
        }
        store_path(place, child);
        outcome.what |= LEFT_FIRST;
    }

#if defined(HAS_DIELECTRIC) || defined(HAS_GRATING)
    child = child_of(path, hit, entering);
    lives = rest_lives;
    if (HAS_GRATING && rest_lives) child = rest;
    if (BAND_CUTS) {
        if (!RAY_POOL && at >= 0.0) {
            child = part_of_band(start, at, start.band.z, 1.0 - below, 6u);
            lives = true;
        }
        if (parts) {
            vec3 power = spectral_row(power_row(path), part.band), whole = spectral_row(power_row(path), path.band);
            child.walk.flux_w *= clamp((power.z - power.x) / max(whole.z - whole.x, 1e-30), 0.0, 1.0);
            child.throughput = part.throughput;
            child.band = part.band;
            child.direction = part.direction;
            let_through = part.let_through;
            refracted_share = part.power_w / max(carried_w(path), 1e-30);
            // From here on it is this part's power that counts.
            band_w = band_powers(power_row(path), part.band);
        }
    }
    if (HAS_DIELECTRIC && refracts) {
        unhidden = refract_path(child, event);
        send_on(child, event, let_through, companions.transmittance, unhidden, event.refracted.geometric,
            refracted_share, outcome);
        polarise_companions(child, companions, true);
        if (!companions.stay) leave_companions(child);
        if (SURFACE_FILTERS) filter_by(thing.texture, child, refracted_share, outcome);
        lives = survives(child, outcome.roulette_w, refracted_share, 2u);
    }
    if (RAY_POOL && !lives && second_slot != slot) {
        // It was given room already, where nobody is to be found then.
        child.depth = NONE;
        lives = true;
    }
    if (lives) {
        store_path(second_place(slot), child);
        outcome.what |= LEFT_SECOND;
    }
#endif
}
