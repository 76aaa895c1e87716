// Bands of the spectrum in flight, for `trace.comp`: cut where total internal reflection sets in, or parted where they may not be.
#if SPECTRAL_GROUPS > 0
// Spectral columns are derivatives too. Grazing exits and curved surfaces, again and again inside a solid, make some of them so steep that they would
// throw the ends of a band all over the scene, and out of it, where no light of the band goes.
void keep_sweeps_within(inout RayRecord ray)
{
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float sweep = length(ray.ddirection[SPATIAL + g].xyz) * abs(variable_step(uint(g), ray.x_hi, ray.x_lo));
        float kept = min(1.0, p.widest_sweep / max(sweep, 1e-30));
        ray.dposition[SPATIAL + g].xyz *= kept;
        ray.ddirection[SPATIAL + g].xyz *= kept;
    }
}
#endif

#ifdef BAND_CUTS
// Whether `at` leaves a band too little on one side of it to be worth a path of its own.
bool leaves_sliver(RayRecord ray, float at)
{
    return min(at - ray.x_lo, ray.x_hi - at) <= 0.01 * MIN_CUT_BAND;
}

// `at`, where the parts [lo, at] and [at, hi] of a ray's band may set out again from where its flight started; else a negative number.
float clear_cut(RayRecord ray, RayRecord start, float at, float distance)
{
    vec3 low = vec3(0.0), high = vec3(0.0);
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        low += variable_step(uint(g), 0.5 * (ray.x_lo + at), ray.x_anchor) * start.dposition[SPATIAL + g].xyz;
        high += variable_step(uint(g), 0.5 * (at + ray.x_hi), ray.x_anchor) * start.dposition[SPATIAL + g].xyz;
    }
    return !leaves_sliver(ray, at) && starts_stay_near(low, high, distance) ? at : -1.0;
}

// The part [lo, hi] of a ray's band, with this share of its power, traced at its own middle: position and direction follow the spectral
// columns, weights are interpolated.
RayRecord part_of_band(RayRecord ray, float lo, float hi, float share, uint branch)
{
    float x = 0.5 * (lo + hi);
#ifdef POLARISED
    Polarisation state = polarisation_of_part(ray, vec3(lo, x, hi));
#endif
    ray.throughput = band_weights(band_of(ray), ray.throughput, vec3(lo, x, hi));
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float change = variable_step(uint(g), x, ray.x_anchor);
        ray.position += change * ray.dposition[SPATIAL + g].xyz;
        ray.direction += change * ray.ddirection[SPATIAL + g].xyz;
    }
    ray.direction = normalize(ray.direction);
#ifdef POLARISED
    keep_polarisation_of_part(ray, state);
#endif
    ray.x_lo = lo;
    ray.x_hi = hi;
    ray.x_anchor = x;
    ray.flux_w *= share;
    // Roulette counts by power, also where a band was only divided: or cuts would breed.
    ray.survival *= share;
    ray.branch_key = hash_combine(ray.branch_key, branch);
    // It meets the surface again, and is not cut there a second time.
    ray.flags |= FLAG_BAND_FINAL;
    return ray;
}
#endif

#ifdef HAS_DIELECTRIC
#ifdef SPECTRAL_WEIGHTS
#if SPECTRAL_GROUPS > 0
// Derivative of the cosine of incidence by group g's variable.
float incidence_column(RayRecord ray, ShadingFrame frame, int g)
{
    return dot(ray.ddirection[SPATIAL + g].xyz, frame.normal) + dot(ray.direction, NORMAL_COLUMN(SPATIAL + g));
}
#endif

// Cosine of incidence over the band.
vec3 incidence_over_band(RayRecord ray, ShadingFrame frame)
{
    vec3 theta = vec3(dot(ray.direction, frame.normal));
#if SPECTRAL_GROUPS > 0
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float dtheta = incidence_column(ray, frame, g);
        theta.x += dtheta * variable_step(uint(g), ray.x_lo, ray.x_anchor);
        theta.z += dtheta * variable_step(uint(g), ray.x_hi, ray.x_anchor);
    }
    theta.xz = clamp(theta.xz, -1.0, -1e-6);
#endif
    return theta;
}
#endif

#ifdef BAND_CUTS
// Where the band is cut because total internal reflection sets in inside it, at `onset`; negative: nowhere. `start`: the ray before its
// flight, from which both parts set out again.
float cut_of_band(RayRecord ray, RayRecord start, ShadingFrame frame, float distance, MediumInterface boundary, vec3 cosine2, out float onset)
{
    bvec3 passes = greaterThan(cosine2, vec3(0.0));
    onset = -1.0;
    if (!any(passes) || all(passes)) return -1.0;
    float dtheta[SPECTRAL_GROUPS];
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) dtheta[g] = incidence_column(ray, frame, g);
    onset = total_reflection_onset(band_of(ray), dot(ray.direction, frame.normal), dtheta, vec2(0.0), boundary, passes);
    bool is_final = (ray.flags & FLAG_BAND_FINAL) != 0u || ray.x_hi - ray.x_lo <= MIN_CUT_BAND;
    return is_final ? -1.0 : clear_cut(ray, start, onset, distance);
}

// The part of a ray's band that goes through a surface which its anchor does not pass, where that band may not be cut: from where the ray
// itself is, at an anchor of its own.
struct PassingPart {
    vec3 band;          // x: lowest, anchor, highest
    vec3 throughput;    // there, before the surface
    vec3 let_through;   // shares there
    vec3 direction;     // of incidence at its anchor
    float power_w;      // behind the surface
#ifdef POLARISED
    Polarisation seen;  // before it, in its plane of incidence
    FresnelPair transmission;
#endif
};

// `n_i`, `n_t` and `refracted` become the part's, `reflectance` what is left of the whole band: both together carry what the ray did.
PassingPart passing_part(RayRecord ray, ShadingFrame frame, MediumInterface boundary, float onset, vec3 cosine2, inout vec3 reflectance, inout vec3 n_i, inout vec3 n_t, inout Deflection refracted)
{
    bool low = cosine2.x > 0.0;
    PassingPart part;
    part.band = low ? vec3(ray.x_lo, 0.5 * (ray.x_lo + onset), onset) : vec3(onset, 0.5 * (onset + ray.x_hi), ray.x_hi);
    part.throughput = band_weights(band_of(ray), ray.throughput, part.band);
    interface_indices(boundary, part.band, n_i, n_t);
    float theta = dot(ray.direction, frame.normal);
    vec3 moved = ray.direction;
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float change = variable_step(uint(g), part.band.y, ray.x_anchor);
        theta += change * incidence_column(ray, frame, g);
        moved += change * ray.ddirection[SPATIAL + g].xyz;
    }
    theta = clamp(theta, -1.0, -1e-6);
    vec3 tangential = moved - dot(moved, frame.normal) * frame.normal;
    float sine2 = (1.0 - theta) * (1.0 + theta), eta_it = n_i.y / n_t.y;
    part.direction = theta * frame.normal + sqrt(sine2 / max(dot(tangential, tangential), 1e-20)) * tangential;
    refracted = refract_at(frame, part.direction, eta_it);
#ifdef POLARISED
    vec3 s[3], eta = low ? (n_i / n_t).xyy : (n_i / n_t).yyz, cosines = incidence_over_band(ray, frame);
    planes_of_incidence(ray, frame, s);
    // At the onset nothing passes, and its state does not matter.
    cosines = low ? vec3(cosines.x, theta, theta) : vec3(theta, theta, cosines.z);
    part.seen = band_polarisation(met_in_plane(ray, s), band_of(ray), ray.throughput, part.band);
    part.transmission = fresnel_transmission(fresnel_reflection(cosines, eta, transmitted_cosine2(cosines, eta)));
    float anchors = polarised_share(part.seen, part.transmission).y;
#else
    float anchors = 1.0 - fresnel_reflectance(theta, eta_it, transmitted_cosine2(theta, eta_it));
#endif
    part.let_through = refracted.exists ? vec3(low ? 1.0 - reflectance.x : 0.0, anchors, low ? 0.0 : 1.0 - reflectance.z) : vec3(0.0);
    vec3 density_w = band_powers(power_row(ray), part.band);
    part.power_w = dot(density_w, part.throughput * part.let_through);
    // What the ray's end has: more cannot leave it.
    float most_w = max(low ? band_w.x * ray.throughput.x : band_w.z * ray.throughput.z, 0.0);
    part.let_through *= part.power_w > most_w ? most_w / part.power_w : 1.0;
    part.power_w = clamp(part.power_w, 0.0, most_w);
    float kept = 1.0 - part.power_w / max(most_w, 1e-30);
    reflectance = low ? vec3(kept, 1.0, 1.0) : vec3(1.0, 1.0, kept);
    return part;
}
#endif
#endif
