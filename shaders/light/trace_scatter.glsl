// What becomes of a ray where it meets glass, a mirror or a grating, and of a band that is cut before it lands, for `trace.comp`.
// A ray that goes on from what it has hit, on that object's inner side or not.
RayRecord child_of(RayRecord ray, Hit hit, bool inside)
{
    ray.last_primitive = hit.primitive;
    ray.last_object = hit.object;
    ray.flags = (ray.flags & FLAG_FOOTPRINT_DROPPED) | (inside ? FLAG_INSIDE : 0u);
    ray.depth += 1u;
    return ray;
}

// Turned, with this share of the ray's power at the three places of its band. Columns are left to the callers.
void send_on(inout RayRecord child, Deflection turned, vec3 share, inout Outcome outcome)
{
    child.direction = turned.direction;
    child.flux_w *= share.y;
    child.throughput *= share;
#ifdef ROUGH_SURFACES
    // Behind a microfacet that is no fall-back but shadow.
    if (surface_width > 0.0) return;
#endif
    outcome.what |= turned.geometric ? FELL_NORMAL : 0u;
}

#ifdef SURFACE_FILTERS
// What a surface of glass lets through of what enters; the rest is absorbed. `share`: of the ray, for roulette.
void filter_by(uint row, inout RayRecord child, inout float share, inout Outcome outcome)
{
    if (row == NONE) return;
    vec3 kept = spectral_row(uint(WEIGHT_ROW) + row, band_of(child));
    outcome.absorbed_w += carried_w(child);
    child.flux_w *= kept.y;
    child.throughput *= kept;
    outcome.absorbed_w -= carried_w(child);
#ifdef HERO
    vec3 companions = spectral_row(uint(WEIGHT_ROW) + row, child.companion_x.xyz);
    child.companion_throughput.xyz *= companions;
    kept.y = common_share(child, kept.y, companions);
#endif
    share *= kept.y;
}
#endif

#include "light/trace_grating.glsl"

// Each child is stored in one place, whichever event made it: where every branch is executed, every
// store costs even when no ray takes it. `border`: where the band is cut before it lands; negative: nowhere.
void scatter(RayRecord ray, RayRecord start, Hit hit, ShadingFrame frame, uint kind, Object thing, float border, uint slot, inout Outcome outcome)
{
    bool entering = dot(ray.direction, hit.normal_g) < 0.0;
    uint weight_row = thing.weight_row;
    outcome.what |= frame.refused != 0u ? FELL_NORMAL : 0u;
    if ((ray.light_and_source >> 16) == 0xffffu)
        ray.light_and_source = (ray.light_and_source & 0xffffu) | (hit.object << 16);

#ifdef NORMAL_DERIVATIVES
    for (int c = 0; c < COLUMNS; ++c) normal_columns[c] = normal_column(frame, ray.dposition[c].xyz);
#elif defined(HAS_NORMAL_COLUMNS)
    for (int c = 0; c < COLUMNS; ++c) normal_columns[c] = vec3(0.0);
#endif
#ifdef ROUGH_SURFACES
    RoughPlace rough = meet_microfacet(ray, frame);
#endif
    RayRecord child = child_of(ray, hit, !entering);
    bool lives = false;
    Deflection reflected = reflect_at(frame, ray.direction);
#ifdef POLARISED
    vec3 s[3];
    planes_of_incidence(ray, frame, s);
#endif
#if COLUMNS > 0
    for (int c = 0; c < COLUMNS; ++c)
        child.ddirection[c].xyz = reflected_column(reflected, ray.direction, ray.ddirection[c].xyz, NORMAL_COLUMN(c));
#endif
#ifdef HAS_MIRROR
    if (kind == KIND_MIRROR) {
        vec3 kept = spectral_row(uint(WEIGHT_ROW) + weight_row, band_of(ray));
        outcome.what |= ABSORBED;
        send_on(child, reflected, kept, outcome);
#ifdef POLARISED
        polarise(child, met_in_plane(ray, s), mirror_reflection(), s);
#ifdef HERO
        polarise_companions(child, companions_in_plane(ray, s), mirror_reflection(), s);
#endif
#endif
        outcome.flux_w = carried_w(ray) - carried_w(child);
        float share = kept.y;
#ifdef HERO
        vec3 companions = spectral_row(uint(WEIGHT_ROW) + weight_row, ray.companion_x.xyz);
        child.companion_throughput.xyz *= companions;
        share = common_share(ray, kept.y, companions);
#endif
        lives = survives(child, outcome.roulette_w, share, 3u);
    }
#endif
#ifdef HAS_GRATING
    RayRecord rest = start;
    bool rest_lives = false;
    if (kind == KIND_GRATING) lives = diffract(ray, hit, frame, weight_row, child, rest, rest_lives, outcome);
#endif
#ifdef HAS_DIELECTRIC
    MediumInterface boundary = cross_boundary(medium_stack(ray), hit.object, entering);
    bool splits = IS_GLASS(kind) && boundary.changes;
    vec3 n_i, n_t;
#ifdef SPECTRAL_WEIGHTS
    interface_indices(boundary, band_of(ray), n_i, n_t);
    vec3 theta = incidence_over_band(ray, frame);
#else
    n_i = vec3(medium_index(boundary.before, ray.x_anchor));
    n_t = vec3(medium_index(boundary.after, ray.x_anchor));
    vec3 theta = vec3(dot(ray.direction, frame.normal));
#endif
    vec3 cosine2 = transmitted_cosine2(theta, n_i / n_t);
#ifdef ROUGH_SURFACES
    if (splits && rough.width > 0.0) rough.regained = regained(surface_table, -dot(ray.direction, rough.normal), n_i / n_t);
#endif
#ifdef POLARISED
    Polarisation seen = met_in_plane(ray, s);
    FresnelPair reflection = fresnel_reflection(theta, n_i / n_t, cosine2);
    reflection = OF_SHEET(boundary, reflection);
    vec3 reflectance = polarised_share(seen, reflection);
#else
    vec3 reflectance = fresnel_reflectance(theta, n_i / n_t, cosine2);
    reflectance = OF_SHEET(boundary, reflectance);
#endif
    GO_STRAIGHT(boundary, theta, n_i, n_t, cosine2)
    Deflection refracted = refract_at(frame, ray.direction, n_i.y / n_t.y);
#ifdef ANCHOR_WEIGHTS
    reflectance = vec3(reflectance.y);
#endif
    // Where only the facet's normal forbids it, nothing is transmitted at any wavelength; at total reflection each has its own share.
#ifdef ROUGH_SURFACES
    // A microfacet's share is its own, also where the light that it lets through does not leave the surface.
    if (rough.width <= 0.0)
#endif
    if (!refracted.exists && cosine2.y > 0.0) reflectance = vec3(1.0);
    float reflected_share = reflectance.y, refracted_share = 1.0 - reflectance.y;
#ifdef HERO
    vec3 companion_n_i, companion_n_t;
    interface_indices(boundary, ray.companion_x.xyz, companion_n_i, companion_n_t);
    vec3 companion_eta = companion_n_i / companion_n_t;
#ifdef POLARISED
    Polarisation companions_seen = companions_in_plane(ray, s);
    FresnelPair companion_reflection = fresnel_reflection(theta, companion_eta, transmitted_cosine2(theta, companion_eta));
    companion_reflection = OF_SHEET(boundary, companion_reflection);
    vec3 companion_reflectance = polarised_share(companions_seen, companion_reflection);
#else
    vec3 companion_reflectance = fresnel_reflectance(theta, companion_eta, transmitted_cosine2(theta, companion_eta));
    companion_reflectance = OF_SHEET(boundary, companion_reflectance);
#endif
#ifdef ROUGH_SURFACES
    if (rough.width <= 0.0)
#endif
    if (!refracted.exists && cosine2.y > 0.0) companion_reflectance = vec3(1.0);
    reflected_share = common_share(ray, reflectance.y, companion_reflectance);
    // Refracted they stay together only where nothing disperses.
    bool stay = IS_THIN(boundary) || all(lessThan(abs(companion_eta - n_i.y / n_t.y), vec3(1e-7)));
    refracted_share = stay ? common_share(ray, 1.0 - reflectance.y, 1.0 - companion_reflectance) : 1.0 - reflectance.y;
#endif
#ifdef BAND_CUTS
    float onset = -1.0, at = splits ? cut_of_band(ray, start, frame, hit.distance, boundary, cosine2, onset) : border, below = 0.0;
    if (at >= 0.0) {
        // Back to the start of the flight.
        splits = false;
        outcome.absorbed_w = 0.0;
        outcome.what |= FELL_BAND;
        vec3 power = spectral_row(uint(p.power_row), vec3(start.x_lo, at, start.x_hi));
        below = clamp((power.y - power.x) / max(power.z - power.x, 1e-30), 0.0, 1.0);
        child = part_of_band(start, start.x_lo, at, below, 5u);
        lives = true;
    }
    // A part that was cut here ends at the onset: which side of it that end falls on is rounding.
    bool parts = splits && cosine2.y <= 0.0 && onset >= 0.0 && !leaves_sliver(ray, onset);
    PassingPart part;
    if (parts) part = passing_part(ray, frame, boundary, onset, cosine2, reflectance, n_i, n_t, refracted);
#endif
    if (splits) {
        send_on(child, reflected, reflectance, outcome);
#ifdef ROUGH_SURFACES
        // What neither of both parts has in the end, the surface keeps.
        if (rough.width > 0.0) outcome.absorbed_w += carried_w(ray);
        shadow(rough, child, reflected, 1.0, reflected_share, outcome);
#endif
#ifdef POLARISED
        polarise(child, seen, reflection, s);
#ifdef HERO
        polarise_companions(child, companions_seen, companion_reflection, s);
#endif
#endif
#ifdef HERO
        child.companion_throughput.xyz *= companion_reflectance;
#endif
        lives = reflected_share > 0.0 && survives(child, outcome.roulette_w, reflected_share, 1u);
    }
    if (IS_GLASS(kind) && !boundary.changes) {
        // Another solid decides here: walk through, only remember where we are.
        child = child_of(ray, hit, entering);
        child.depth = ray.depth;
        child.inside_mask = boundary.behind.mask;
        lives = true;
    }
#endif
    if (lives) {
        store_ray(2u * slot, child);
        outcome.what |= LEFT_FIRST;
    }

#if defined(HAS_DIELECTRIC) || defined(HAS_GRATING)
    child = child_of(ray, hit, entering);
    lives = false;
#ifdef HAS_GRATING
    if (rest_lives) {
        child = rest;
        lives = true;
    }
#endif
#ifdef HAS_DIELECTRIC
#ifdef BAND_CUTS
    if (at >= 0.0) {
        child = part_of_band(start, at, start.x_hi, 1.0 - below, 6u);
        lives = true;
    }
#endif
    vec3 incident = ray.direction;
    float x_anchor = ray.x_anchor;
#ifdef BAND_CUTS
    if (parts) {
        vec3 power = spectral_row(power_row(ray), part.band), whole = spectral_row(power_row(ray), band_of(ray));
        child.flux_w *= clamp((power.z - power.x) / max(whole.z - whole.x, 1e-30), 0.0, 1.0);
        child.throughput = part.throughput;
        child.x_lo = part.band.x;
        child.x_anchor = x_anchor = part.band.y;
        child.x_hi = part.band.z;
        incident = part.direction;
        reflectance = 1.0 - part.let_through;
        refracted_share = part.power_w / max(carried_w(ray), 1e-30);
        // From here on it is this part's power that counts.
        band_w = band_powers(power_row(ray), part.band);
    }
#endif
    if (splits && refracted.exists) {
        send_on(child, refracted, 1.0 - reflectance, outcome);
#ifdef HERO
        child.companion_throughput.xyz *= 1.0 - companion_reflectance;
        if (!stay) leave_companions(child);
#endif
#ifdef POLARISED
        FresnelPair transmission = fresnel_transmission(reflection);
#ifdef BAND_CUTS
        if (parts) {
            seen = part.seen;
            transmission = part.transmission;
        }
#endif
        polarise(child, seen, transmission, s);
#ifdef HERO
        polarise_companions(child, companions_seen, fresnel_transmission(companion_reflection), s);
#endif
#endif
        child.inside_mask = boundary.behind.mask;
        child.inside_object = boundary.behind.object;
#if COLUMNS > 0
        for (int c = 0; c < COLUMNS; ++c) {
            float deta_it = 0.0;
#if SPECTRAL_GROUPS > 0
            if (c >= SPATIAL && c < LOBE) deta_it = index_ratio_derivative(boundary, uint(c - SPATIAL), x_anchor, n_i.y, n_t.y);
#endif
            child.ddirection[c].xyz = refracted_column(refracted, incident, ray.ddirection[c].xyz, NORMAL_COLUMN(c), n_i.y / n_t.y, deta_it);
        }
#endif
#ifdef ROUGH_SURFACES
        shadow(rough, child, refracted, -1.0, refracted_share, outcome);
#endif
#ifdef SURFACE_FILTERS
        filter_by(thing.texture, child, refracted_share, outcome);
#endif
        lives = survives(child, outcome.roulette_w, refracted_share, 2u);
    }
#endif
    if (lives) {
        store_ray(2u * slot + 1u, child);
        outcome.what |= LEFT_SECOND;
    }
#endif
}
