// A ray from a diffuse surface that meets glass or a mirror first, followed backwards to where its light comes from:
// which lobe it takes is chance by Fresnel's reflectance. At one index, with tints at three wavelengths; or, where
// GATHERED_SPECTRUM, traced at the anchor, one of GATHER_TAPS wavelengths spread over the spectrum, all of which it
// represents by its spectral columns as long as they are not reflected totally where it is refracted, or the reverse.

#include "lib/random.glsl"

#define SPATIAL 0
#define HAS_NORMAL_COLUMNS (NORMAL_DERIVATIVES && SPECTRAL_GROUPS > 0)
#if GATHERED_SPECTRUM
#define PATH_COLUMNS SPECTRAL_GROUPS
#define TINTS (GATHER_TAPS / 3)
#else
#define PATH_COLUMNS 0
#define TINTS 1
#endif
struct Walk {
    vec3 x[TINTS];  // spectral coordinates: of red, green and blue; of the wavelengths represented
    vec3 tint[TINTS];  // share of the light that arrives at these
    uint taps;  // bits of the wavelengths that the anchor still represents
};
#include "path/event.glsl"
#include "path/crystal.glsl"
#include "path/grating.glsl"
#include "path/polariser.glsl"

struct FollowedRay {
    Path path;
    Hit hit;
    uint events;  // of glass and mirrors; 0: it met none, or was given up
    uint met;  // 1: `hit` is where it ends; 0: it leaves the scene
};

// Multiplies the tints by a spectral table's row, or where `depth` is not negative by exp(-depth * row).
void tint_by(inout Walk walk, uint row, float depth) {
    for (int t = 0; t < TINTS; ++t) {
        vec3 x = walk.x[t], value = vec3(spectral_row(row, x.x), spectral_row(row, x.y), spectral_row(row, x.z));
        walk.tint[t] *= depth >= 0.0 ? exp(-depth * value) : value;
    }
}

// Which of three wavelengths are represented, as 1 or 0.
vec3 represented(uint taps, int t) { return vec3((uvec3(taps) >> (uvec3(0u, 1u, 2u) + 3u * uint(t))) & 1u); }

// The anchor alone remains of what a path represents, and stands for all of that.
void keep_anchor(inout Path path) {
    float all = float(bitCount(path.walk.taps));
    uint kept = 0u;
    for (int t = 0; t < TINTS; ++t) {
        for (int c = 0; c < 3; ++c) kept |= path.walk.x[t][c] == path.band.y ? 1u << uint(3 * t + c) : 0u;
        path.walk.tint[t] *= all;
    }
    path.walk.taps &= kept;
    for (int t = 0; t < TINTS; ++t) path.walk.tint[t] *= represented(path.walk.taps, t);
}

// What a film reflects or lets through about red, green and blue.
vec3 film_lobe(Path path, Event event, bool reflects) {
    vec3 x = path.walk.x[0], high = vec3(1.0, 0.5 * (x.xy + x.yz)), low = vec3(high.yz, 0.0), found;
    float q = 0.0;
    if (POLARISED) q = event.seen.q.y;
    for (int c = 0; c < 3; ++c) found[c] = film_between(event.film, reflects, event.film.cosine.y, q, low[c], high[c]);
    return ROUGH_SURFACES ? reflected_in_all(found, event.ground.thrown) : found;
}

// What glass reflects and lets through at all wavelengths that a path represents.
struct Spectrum {
    vec3 reflected[TINTS], let_through[TINTS];
    uint passing;  // those that are refracted with the anchor
};

// Returns the probability of following the reflection: the mean over those that are refracted with the anchor.
float reflect_spectrum(Path path, Event event, uint kind, out Spectrum spectrum) {
    float sum = 0.0;
    spectrum.passing = 0u;
    bool refused = event.cosine2.y > 0.0 && event.reflectance.y >= 1.0;  // by the facet's normal, for all
    for (int t = 0; t < TINTS; ++t) {
        Event of_three = event_for(path, event, kind, path.walk.x[t]);
        spectrum.reflected[t] = refused ? vec3(1.0) : of_three.reflectance;
        spectrum.let_through[t] = refused ? vec3(0.0) : transmittance_of(of_three);
        vec3 passes = represented(path.walk.taps, t) * vec3(greaterThan(of_three.cosine2, vec3(0.0)));
        spectrum.passing |= (uint(passes.x) | uint(passes.y) << 1u | uint(passes.z) << 2u) << uint(3 * t);
        sum += dot(passes, spectrum.reflected[t]);
    }
    return event.cosine2.y <= 0.0 || refused ? 1.0 : sum / max(float(bitCount(spectrum.passing)), 1.0);
}

// Weighs what a path represents by its shares in the lobe that is followed with probability `chance`. Each of n
// wavelengths may have been the anchor: refracted ones are represented by those that are refracted.
void weigh_spectrum(inout Path path, Spectrum spectrum, bool passes, float chance) {
    float per_passing = float(bitCount(path.walk.taps)) / max(float(bitCount(spectrum.passing)), 1.0);
    for (int t = 0; t < TINTS; ++t)
        path.walk.tint[t] *= passes
            ? represented(spectrum.passing, t) * spectrum.let_through[t] * (per_passing / (1.0 - chance))
            : spectrum.reflected[t] / chance;
    if (passes) path.walk.taps = spectrum.passing;
}

// A ray into one of a crystal's lobes, by chance; the anchor alone goes on. Whether it went through.
bool follow_lobe(inout Path path, Event event, uint filter_row, float draw) {
    if (GATHERED_SPECTRUM) keep_anchor(path);
    CrystalEvent met = crystal_event(path, event);
    uint chosen = chosen_lobe(met.shares[1], draw);
    bool onward = (chosen & LOBE_ONWARD) != 0u, geometric;
    turn_crystal(path, event, met, chosen, geometric);
    if (SURFACE_FILTERS && onward && filter_row != NONE) tint_by(path.walk, uint(WEIGHT_ROW) + filter_row, -1.0);
    return onward;
}

// A ray into one of a grating's orders, by chance in proportion to their efficiencies; of what is deflected or weighed
// by wavelength the anchor alone goes on. Whether it went through.
bool follow_order(inout Path path, Hit hit, Event event, uint row, uint key, uint number) {
    GratingEvent met = grating_event(path, event.frame.normal, hit, row);
    float all = 0.0;
    for (uint k = 0u; k < met.grating.orders; ++k) all += order_at(row, k).efficiency;
    float left = unit_float(hash_combine(key, number)) * all;
    uint chosen = 0u;
    for (; chosen + 1u < met.grating.orders && left >= order_at(row, chosen).efficiency; ++chosen)
        left -= order_at(row, chosen).efficiency;
    GratingOrder order = order_drawn(met, chosen, 0u, number, key);
    if (order.shift_per_um != 0.0 || (GRATING_PROFILES && met.grating.profile != 0u)) keep_anchor(path);
    bool exists = order_passes(met, order, path.direction, path.band.y), geometric;
    float share = order_shares(met, order, chosen, path, path.band, true).y * all / max(order.efficiency, 1e-9);
    for (int t = 0; t < TINTS; ++t) path.walk.tint[t] *= exists ? share : 0.0;
    diffract_path(path, event, met, order, geometric);
    return !is_reflective(met.grating);
}

// `walk`: with its wavelengths; `x_anchor`: one of them, or that of the index. `lost`: 1 where the ray was given up
// after MAX_EVENTS.
FollowedRay follow_specular(
    vec3 position, vec3 direction, RayOrigin origin, uint key, Walk walk, float x_anchor, inout float lost) {
    FollowedRay ray;
    ray.events = ray.met = 0u;
    Path path = path_at(position, direction, origin, MediumStack(0u, NONE), x_anchor);
    if (GATHERED_SPECTRUM) path.band = vec3(0.0, x_anchor, 1.0);
    path.walk = walk;
    bool follows = true;
    for (uint number = 0u; number < uint(MAX_EVENTS) && follows; ++number) {
        Hit hit;
        bool met = intersect_closest(path.position, path.direction, FAR_DISTANCE, path.origin, hit);
        Object thing = object_at(met ? hit.object : 0u);
        uint kind = met ? thing.kind : NONE;
        bool grating = HAS_GRATING && GATHERED_SPECTRUM && kind == KIND_GRATING;
        follows = kind == KIND_MIRROR || IS_GLASS(kind) || (HAS_POLARISER && kind == KIND_POLARISER) || grating;
        bool entering = dot(path.direction, hit.normal_g) < 0.0;
        if (ABSORPTION) {
            // A place in a liquid learns so where it leaves it.
            if (number == 0u && kind == KIND_DIELECTRIC && !entering && !is_inside(path.medium))
                path.medium.object = hit.object;
            uint row = met ? medium_weight_row(path.medium) : NONE;
            if (row != NONE) tint_by(path.walk, uint(WEIGHT_ROW) + row, hit.distance);
        }
        if (!follows) {
            ray.met = uint(met);
            ray.hit = hit;
        } else {
            ray.events = number + 1u;
            Triangle facet = hit_triangle(hit);
            if (GATHERED_SPECTRUM) {
                transfer_columns(path, hit.normal_g, hit.distance);
                if (!columns_hold(path)) keep_anchor(path);
            }
            path.position = surface_point(hit, facet, path.position, path.direction);
            Event event = meet(path, hit, facet, thing, MicrofacetDraw(0u, number, hash_combine(key, 0x100u)));
            bool crystal = parts_waves(event, kind);
            if (!crystal) weigh(path, kind, event);
            bool passes = false, changes = true, geometric;
            vec3 unhidden = vec3(1.0);
            if (HAS_MIRROR && kind == KIND_MIRROR) {
                tint_by(path.walk, uint(WEIGHT_ROW) + thing.weight_row, -1.0);
                if (ROUGH_SURFACES && !(HAS_FILM && FILM_MET(event))) unhidden = event.reflectance;
            }
            if (HAS_FILM && HAS_MIRROR && kind == KIND_MIRROR && FILM_MET(event)) {
                for (int t = 0; t < TINTS; ++t)
                    path.walk.tint[t] *= GATHERED_SPECTRUM ? event_for(path, event, kind, path.walk.x[t]).reflectance
                                                           : film_lobe(path, event, true);
            }
            if (HAS_CRYSTAL && crystal)
                passes = follow_lobe(path, event, thing.texture, unit_float(hash_combine(key, number)));
            if (HAS_GRATING && GATHERED_SPECTRUM && grating)
                passes = follow_order(path, hit, event, thing.weight_row, key, number);
            if (HAS_POLARISER && kind == KIND_POLARISER) {
                if (GATHERED_SPECTRUM && thing.medium != NONE) keep_anchor(path);
                float share = pass_polariser(path, crystal_at(thing.receiver)).y;
                for (int t = 0; t < TINTS; ++t) path.walk.tint[t] *= share;
                passes = true;
            }
            if (HAS_DIELECTRIC && IS_GLASS(kind) && !crystal) {
                changes = event.boundary.changes;
                float chance = event.reflectance.y;
                Spectrum spectrum;
                bool by_film = HAS_FILM && !GATHERED_SPECTRUM && FILM_MET(event) && event.refracted.exists;
                if (HAS_FILM && by_film) chance = clamp(dot(film_lobe(path, event, true), vec3(1.0 / 3.0)), 0.05, 0.95);
                if (GATHERED_SPECTRUM && changes) chance = reflect_spectrum(path, event, kind, spectrum);
                passes = !changes || (event.cosine2.y > 0.0 && unit_float(hash_combine(key, number)) >= chance);
                if (HAS_FILM && by_film)
                    path.walk.tint[0] *= film_lobe(path, event, !passes) / (passes ? 1.0 - chance : chance);
                if (GATHERED_SPECTRUM && changes) weigh_spectrum(path, spectrum, passes, chance);
                if (!changes)
                    path.medium = event.boundary.behind;
                else if (passes) {
                    if (GATHERED_SPECTRUM && path.restricted == 0u && parts_wavelengths(event)) {
                        path.restricted = 1u;
                        if (SPECTRAL_GROUPS == 0) keep_anchor(path);
                    }
                    unhidden = refract_path(path, event);
                    if (SURFACE_FILTERS && thing.texture != NONE)
                        tint_by(path.walk, uint(WEIGHT_ROW) + thing.texture, -1.0);
                }
            }
            if (!passes && !crystal && !grating) unhidden *= reflect_path(path, event, geometric);
            for (int t = 0; t < TINTS; ++t) path.walk.tint[t] *= unhidden.y;
            leave_surface(path, hit, passes ? entering : !entering);
            lost = float(number + 1u == uint(MAX_EVENTS));
        }
    }
    if (follows)
        ray.events = 0u;
    else
        lost = 0.0;
    ray.path = path;
    return ray;
}

// A direction towards the sphere that holds all glass and mirrors, or anywhere above where that is near: its weight is
// cosine over probability.
vec3 toward_specular(vec4 sphere, vec3 position, vec3 normal, vec2 place, out float weight, out bool narrow) {
    vec3 way = sphere.xyz - position;
    float distance2 = dot(way, way), sine2 = sphere.w * sphere.w / max(distance2, 1e-20);
    narrow = sine2 < 0.5;
    // 1 - cos, without cancelling.
    float opening = sine2 / (1.0 + sqrt(max(1.0 - sine2, 0.0)));
    float cosine = narrow ? 1.0 - place.x * opening : sqrt(1.0 - place.x);
    vec3 axis = narrow ? way * inversesqrt(distance2) : normal;
    vec3 across = normalize(cross(axis, abs(axis.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0)));
    float sine = sqrt(max(1.0 - cosine * cosine, 0.0)), angle = 6.28318530718 * place.y;
    vec3 direction = cosine * axis + sine * (cos(angle) * across + sin(angle) * cross(axis, across));
    weight = narrow ? 6.28318530718 * opening * dot(direction, normal) : 3.14159265359;
    return direction;
}
