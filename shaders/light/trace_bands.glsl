// Bands of the spectrum in flight, for `trace.comp`: cut where total internal reflection sets in, or parted where they
// may not be.
// Spectral columns are derivatives too. Grazing exits and curved surfaces, again and again inside a solid, make some of
// them so steep that they would throw the ends of a band all over the scene, and out of it, where no light of the band
// goes. Such a band stays where its anchor lands: near others like it, so that together they still cover what it would.
void keep_sweeps_within(inout Path path) {
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float sweep = length(path.ddirection[SPATIAL + g]) * abs(variable_step(uint(g), path.band.z, path.band.x));
        float kept = sweep > p.widest_sweep ? 0.0 : 1.0;
        path.dposition[SPATIAL + g] *= kept;
        path.ddirection[SPATIAL + g] *= kept;
    }
}

// The path of the ray in `slot` as it sets out.
Path start_in(uint slot) {
    Path path = load_path(slot);
    if (SPECTRAL_GROUPS > 0) keep_sweeps_within(path);
    return path;
}

// On a GPU it is read again where it is wanted, and takes no registers before.
#define START(start, slot) (RAY_POOL ? start_in(slot) : start)

// Whether `at` leaves a band too little on one side of it to be worth a path of its own.
bool leaves_sliver(Path path, float at) { return min(at - path.band.x, path.band.z - at) <= 0.01 * MIN_CUT_BAND; }

// `at`, where the parts [lo, at] and [at, hi] of a path's band may set out again from where its flight started; else a
// negative number.
float clear_cut(Path path, Path start, float at, float distance) {
    vec3 middles = 0.5 * (path.band.xyz + vec3(at, at, at));
    return !leaves_sliver(path, at) && starts_are_near(start, middles.x, middles.z, distance) ? at : -1.0;
}

// The part [lo, hi] of a path's band, with this share of its power, traced at its own middle. Roulette counts by power,
// also where a band was only divided: or cuts would breed. It meets the surface again, and is not cut there a second
// time.
Path part_of_band(Path path, float lo, float hi, float share, uint branch) {
    restrict_to(path, vec3(lo, 0.5 * (lo + hi), hi));
    path.walk.flux_w *= share;
    path.walk.survival *= share;
    path.walk.branch_key = hash_combine(path.walk.branch_key, branch);
    path.recut = 1u;
    return path;
}

// Share of the power of a path's band that lies below `at`.
float power_below(Path path, float at) {
    vec3 power = spectral_row(uint(p.power_row), vec3(path.band.x, at, path.band.z));
    return clamp((power.y - power.x) / max(power.z - power.x, 1e-30), 0.0, 1.0);
}

// Where the band is cut because total internal reflection sets in inside it, at `onset`; negative: nowhere. `start`:
// the path before its flight, in `slot`, from which both parts set out again.
float cut_of_band(Path path, Path start, uint slot, Event event, float distance, out float onset) {
    onset = total_reflection_in_band(path, event);
    bool is_final = path.recut != 0u || path.band.z - path.band.x <= MIN_CUT_BAND;
    return onset < 0.0 || is_final ? -1.0 : clear_cut(path, START(start, slot), onset, distance);
}

// The part of a path's band that goes through a surface which its anchor does not pass, where that band may not be cut:
// from where the path itself is, at an anchor of its own.
struct PassingPart {
    vec3 band;  // x: lowest, anchor, highest
    vec3 throughput;  // there, before the surface
    vec3 let_through;  // shares there
    vec3 direction;  // of incidence at its anchor
    float power_w;  // behind the surface
};

// `event` becomes the part's where it refracts, and reflects what is left of the whole band: both together carry what
// the path did.
PassingPart passing_part(Path path, inout Event event, float onset) {
    bool low = event.cosine2.x > 0.0;
    vec3 normal = event.frame.normal;
    PassingPart part;
    part.band = low ? vec3(path.band.x, 0.5 * (path.band.x + onset), onset)
                    : vec3(onset, 0.5 * (onset + path.band.z), path.band.z);
    part.throughput = band_weights(path.band, path.throughput, part.band);
    float theta = dot(path.direction, normal);
    vec3 moved = path.direction;
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float change = variable_step(uint(g), part.band.y, path.band.y);
        theta += change * incidence_column(path, event, g);
        moved += change * path.ddirection[SPATIAL + g];
    }
    theta = clamp(theta, -1.0, -1e-6);
    vec3 tangential = moved - dot(moved, normal) * normal;
    float sine2 = (1.0 - theta) * (1.0 + theta);
    part.direction = theta * normal + sqrt(sine2 / max(dot(tangential, tangential), 1e-20)) * tangential;
    // At the onset nothing passes, and its state does not matter.
    Event passing = event;
    passing.theta = low ? vec3(event.theta.x, theta, theta) : vec3(theta, theta, event.theta.z);
    if (POLARISED) passing.seen = event.seen = band_polarisation(event.seen, path.band, path.throughput, part.band);
    share_at(part.band, false, KIND_DIELECTRIC, passing);
    event.n_i = passing.n_i;
    event.n_t = passing.n_t;
    event.refracted = refract_at(event.frame, part.direction, event.n_i.y / event.n_t.y);
    if (POLARISED) event.transmission = passing.transmission;
    vec3 whole = transmittance_of(event);
    part.let_through = event.refracted.exists
        ? vec3(low ? whole.x : 0.0, transmittance_of(passing).y, low ? 0.0 : whole.z)
        : vec3(0.0);
    vec3 density_w = band_powers(power_row(path), part.band);
    part.power_w = dot(density_w, part.throughput * part.let_through);
    // What the path's end has: more cannot leave it.
    float most_w = max(low ? band_w.x * path.throughput.x : band_w.z * path.throughput.z, 0.0);
    part.let_through *= part.power_w > most_w ? most_w / part.power_w : 1.0;
    part.power_w = clamp(part.power_w, 0.0, most_w);
    float kept = 1.0 - part.power_w / max(most_w, 1e-30);
    event.reflectance = low ? vec3(kept, 1.0, 1.0) : vec3(1.0, 1.0, kept);
    return part;
}
