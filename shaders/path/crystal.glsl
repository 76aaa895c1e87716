// A path at the interface of a crystal. An ordinary and an extraordinary wave go back, and two go on; on a side that is
// isotropic both are one lobe, which keeps its state of polarisation. In a crystal a path is one of both waves: their
// phases differ by so much over a band that nothing is left of their interference.

#include "lib/crystal.glsl"
#include "path/event.glsl"

// Medium of an object at x; `normal`: of the interface.
Uniaxial uniaxial_at(uint object, float x, vec3 normal) {
    uint texel = crystal_of(object);
    Uniaxial medium = Uniaxial(normal, vec2(medium_index(object, x)));
    if (texel != NONE) {
        Crystal crystal = crystal_at(texel);
        medium = Uniaxial(crystal.axis, vec2(medium.n.x, spectral_row(uint(INDEX_ROW) + crystal.extraordinary, x)));
    }
    return medium;
}

// Derivatives of an object's n_o and n_e by the variable of column c.
vec2 uniaxial_slopes(uint object, int c, float x) {
    vec2 slopes = vec2(0.0);
    if (SPECTRAL_GROUPS > 0 && c >= SPATIAL && c < SPATIAL + SPECTRAL_GROUPS) {
        uint texel = crystal_of(object), g = uint(c - SPATIAL);
        slopes = vec2(index_slope(object, g, x));
        Crystal crystal = crystal_at(texel != NONE ? texel : 0u);
        float own = MERGED_GROUPS ? spectral_row(uint(SLOPE_ROW) + crystal.extraordinary, x) : 1.0;
        if (texel != NONE) slopes.y = crystal.group == g ? own : 0.0;
    }
    return slopes;
}

#define LOBES 4
#define NO_SHARE 1e-10  // below this a lobe is what rounding makes of none
#define LOBE_ONWARD 2u  // bit of a lobe's number: it goes on, not back
#define LOBE_EXTRAORDINARY 1u  // likewise

// What a path meets at a crystal's interface, for all its lobes.
struct CrystalEvent {
    bool from_crystal, to_crystal;
    bool is_extraordinary;  // the wave that comes in
    vec3 s[3];
    mat3x4 shares;  // of the lobes, at the three places of the band
    Polarisation state;  // of the lobe on the side that is isotropic, counted from s
};

struct TurnedWave {
    vec3 incident, turned;  // wave vectors
    vec3 normal;  // that turned it
    vec3 energy;
    Uniaxial before, behind;
    bool geometric, exists;
};

// One lobe's wave at x of a path along `direction`.
TurnedWave turn_wave(CrystalEvent met, Event event, uint lobe, vec3 direction, vec3 normal, float x) {
    bool onward = (lobe & LOBE_ONWARD) != 0u, extraordinary = (lobe & LOBE_EXTRAORDINARY) != 0u;
    TurnedWave wave;
    wave.normal = normal;
    wave.geometric = false;
    Uniaxial before = uniaxial_at(event.boundary.before, x, normal), behind = before;
    if (onward) behind = uniaxial_at(event.boundary.after, x, normal);
    wave.before = of_kind(before, met.is_extraordinary);
    wave.behind = of_kind(behind, extraordinary);
    wave.incident = wave_of_ray(wave.before, direction);
    for (int i = 0; i < 2; ++i) {
        vec3 way = onward ? -wave.normal : wave.normal;
        vec2 part = forward_part(
            wave.behind, !onward && extraordinary == met.is_extraordinary, wave.incident, length(wave.incident), way);
        wave.exists = part.y == 0.0;
        wave.turned = wave.incident + (part.x - dot(wave.incident, way)) * way;
        wave.energy = energy_of_wave(wave.behind, wave.turned);
        bool wrong = dot(wave.energy, event.frame.normal_g) * (onward ? -1.0 : 1.0) <= 0.0;
        if (event.frame.interpolated == 0u || !wrong || wave.geometric) break;
        wave.geometric = true;
        wave.normal = event.frame.normal_g;
    }
    return wave;
}

// The strongest of all lobes.
uint strongest_lobe(vec4 likely) {
    uint kept = 0u;
    for (int lobe = 0; lobe < LOBES; ++lobe) kept = likely[lobe] > likely[kept] ? uint(lobe) : kept;
    return kept;
}

// One of the lobes, by chance; `draw`: below the sum of all.
uint chosen_lobe(vec4 likely, float draw) {
    uint chosen = 0u;
    for (int lobe = 0; lobe < LOBES; ++lobe) {
        if (likely[lobe] > 0.0 && draw >= 0.0) chosen = uint(lobe);
        draw -= likely[lobe];
    }
    return chosen;
}

// Shares of a lobe over the band.
vec3 lobe_share(CrystalEvent met, uint lobe) { return vec4(equal(uvec4(0u, 1u, 2u, 3u), uvec4(lobe))) * met.shares; }

// The interface at the three places of a path's band. What its anchor does not have, none of the band has.
CrystalEvent crystal_event(Path path, Event event) {
    CrystalEvent met;
    met.from_crystal = crystal_of(event.boundary.before) != NONE;
    met.to_crystal = crystal_of(event.boundary.after) != NONE;
    met.is_extraordinary = met.from_crystal && path.extraordinary != 0u;
    vec3 upright = met.from_crystal ? across_direction(event.frame.normal) : path.polarisation.axis,
         normals[3] = vec3[](event.frame.normal, event.frame.normal, event.frame.normal),
         waves[3] = vec3[](path.direction, path.direction, path.direction);
    if (SPECTRAL_GROUPS > 0 && path.restricted != 0u) {
        for (int end = 0; end < 2; ++end) {
            waves[2 * end] = direction_at_end(path, end);
            normals[2 * end] = normalize(normal_at_end(path, event, end));
        }
    }
    for (int i = 0; i < 3; ++i) {
        Uniaxial before = uniaxial_at(event.boundary.before, path.band[i], normals[i]);
        waves[i] = wave_of_ray(of_kind(before, met.is_extraordinary), waves[i]);
        met.s[i] = incidence_axis(normalize(waves[i]), normals[i], upright);
    }
    vec4 exist;
    for (int lobe = 0; lobe < LOBES; ++lobe)
        exist[lobe] = float(turn_wave(met, event, uint(lobe), path.direction, event.frame.normal, path.band.y).exists);
    met.state = in_plane(path.polarisation, path.direction, met.s);
    for (int i = 0; i < 3; ++i) {
        // Axes of the interface: along the plane of incidence, s and forwards.
        mat3 axes = mat3(-cross(met.s[i], normals[i]), met.s[i], -normals[i]);
        Uniaxial before = uniaxial_at(event.boundary.before, path.band[i], normals[i]),
                 behind = uniaxial_at(event.boundary.after, path.band[i], normals[i]);
        before.axis *= axes;
        behind.axis *= axes;
        vec3 wave = waves[i] * axes;
        vec4 light = vec4(float(!met.is_extraordinary), float(met.is_extraordinary), 0.0, 0.0), back, onward;
        if (!met.from_crystal)
            light = 0.5 * vec4(1.0 + met.state.q[i], 1.0 - met.state.q[i], met.state.u[i], met.state.v[i]);
        cross_interface(before, behind, vec3(wave.x, 0.0, max(wave.z, 1e-6)), length(waves[i]), light, back, onward);
        vec4 one = met.from_crystal ? onward : back;
        float power = one.x + one.y;
        vec3 stokes = vec3(one.x - one.y, 2.0 * one.zw) / max(power, 1e-20);
        met.state.q[i] = stokes.x;
        met.state.u[i] = stokes.y;
        met.state.v[i] = stokes.z;
        if (!met.from_crystal) back.xy = vec2(power, 0.0);
        if (!met.to_crystal) onward.xy = vec2(power, 0.0);
        vec4 shares = vec4(back.xy, onward.xy) * exist;
        shares *= step(NO_SHARE, shares);
        met.shares[i] = shares / max(dot(shares, vec4(1.0)), 1e-20);
    }
    return met;
}

// The path turned into a lobe. `geometric`: the facet's normal had to judge.
void turn_crystal(inout Path path, Event event, CrystalEvent met, uint lobe, out bool geometric) {
    bool onward = (lobe & LOBE_ONWARD) != 0u, extraordinary = (lobe & LOBE_EXTRAORDINARY) != 0u,
         in_crystal = onward ? met.to_crystal : met.from_crystal;
    TurnedWave wave = turn_wave(met, event, lobe, path.direction, event.frame.normal, path.band.y);
    geometric = wave.geometric;
    uint before = event.boundary.before, behind = onward ? event.boundary.after : before;
    for (int c = 0; c < PATH_COLUMNS; ++c) {
        vec2 slopes = of_kind(uniaxial_slopes(before, c, path.band.y), met.is_extraordinary);
        vec3 dwave = wave_column(wave.before, slopes, path.direction, path.ddirection[c]);
        slopes = of_kind(uniaxial_slopes(behind, c, path.band.y), extraordinary);
        path.ddirection[c] = turned_column(wave.behind, slopes, wave.incident, dwave, wave.turned, wave.normal,
            geometric ? vec3(0.0) : NORMAL_COLUMN(event, c));
    }
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end) {
            vec3 position_l, direction_l;
            linear_end(path, end, position_l, direction_l);
            TurnedWave at_end = turn_wave(met, event, lobe, path.end_direction[end],
                geometric ? wave.normal : event.end_normal[end], path.band[2 * end]);
            path.end_direction[end] =
                at_end.exists && at_end.geometric == geometric ? normalize(at_end.energy) : direction_l;
        }
    }
    path.direction = normalize(wave.energy);
    path.extraordinary = uint(in_crystal && extraordinary);
    if (onward) path.medium = event.boundary.behind;
    path.polarisation = unpolarised(path.direction);
    if (!in_crystal) path.polarisation = out_of_plane(met.state, path.direction, met.s);
}
