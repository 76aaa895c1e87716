// A path at the interface of a crystal. An ordinary and an extraordinary wave go back, and two go on; on a side that is
// isotropic both are one lobe, which keeps its state of polarisation. In a crystal a path is one of both waves: their
// phases differ by so much over a band that nothing is left of their interference.

#include "lib/crystal.glsl"
#include "path/event.glsl"

// Medium of an object at x; `normal`: of the interface.
Uniaxial uniaxial_at(uint object, float x, vec3 normal) {
    uint texel = crystal_of(object);
    float n = medium_index(object, x);
    Uniaxial medium = Uniaxial(normal, n, n);
    if (texel != NONE) {
        Crystal crystal = crystal_at(texel);
        medium.axis = crystal.axis;
        medium.n_e = spectral_row(uint(INDEX_ROW) + crystal.extraordinary, x);
    }
    return medium;
}

// Derivatives of an object's n_o and n_e by the variable of group g.
vec2 uniaxial_slopes(uint object, uint g, float x) {
    vec2 slopes = vec2(0.0);
    if (object != NONE && object_at(object).group == g) slopes = vec2(medium_slope(object, x));
    uint texel = crystal_of(object);
    if (texel != NONE) {
        Crystal crystal = crystal_at(texel);
        slopes.y = 0.0;
        if (crystal.group == g)
            slopes.y = MERGED_GROUPS ? spectral_row(uint(SLOPE_ROW) + crystal.extraordinary, x) : 1.0;
    }
    return slopes;
}

#define MOST_LOBES 4u
#define LOBE_ONWARD 2u  // bit of a lobe's number: it goes on, not back
#define LOBE_EXTRAORDINARY 1u  // likewise

// What a path meets at a crystal's interface, for all its lobes.
struct CrystalEvent {
    vec3 normal;  // against the path
    bool from_crystal, to_crystal;
    bool is_extraordinary;  // the wave that comes in
    vec3 s[3];
    // Powers of the ordinary and the extraordinary wave, and real and imaginary part of the product of their fields, at
    // the three places of the band.
    vec4 back[3], onward[3];
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
    wave.before = uniaxial_at(event.boundary.before, x, normal);
    wave.behind = wave.before;
    if (onward) wave.behind = uniaxial_at(event.boundary.after, x, normal);
    wave.incident = wave_of_ray(wave.before, met.is_extraordinary, direction);
    float n = met.is_extraordinary ? length(wave.incident) : wave.before.n_o;
    for (int i = 0; i < 2; ++i) {
        vec3 way = onward ? -wave.normal : wave.normal;
        float part, incident = dot(wave.incident, way);
        wave.exists = normal_part(
            wave.behind, extraordinary, !onward && extraordinary == met.is_extraordinary, wave.incident, n, way, part);
        wave.turned = wave.incident + (part - incident) * way;
        wave.energy = energy_of_wave(wave.behind, extraordinary, wave.turned);
        bool wrong = dot(wave.energy, event.frame.normal_g) * (onward ? -1.0 : 1.0) <= 0.0;
        if (event.frame.interpolated == 0u || !wrong || wave.geometric) break;
        wave.geometric = true;
        wave.normal = event.frame.normal_g;
    }
    return wave;
}

vec3 lobe_share(CrystalEvent met, uint lobe) {
    vec4 low, anchor, high;
    bool onward = (lobe & LOBE_ONWARD) != 0u;
    low = onward ? met.onward[0] : met.back[0];
    anchor = onward ? met.onward[1] : met.back[1];
    high = onward ? met.onward[2] : met.back[2];
    vec3 ordinary = vec3(low.x, anchor.x, high.x), extraordinary = vec3(low.y, anchor.y, high.y);
    if (!(onward ? met.to_crystal : met.from_crystal))
        return (lobe & LOBE_EXTRAORDINARY) != 0u ? vec3(0.0) : ordinary + extraordinary;
    return (lobe & LOBE_EXTRAORDINARY) != 0u ? extraordinary : ordinary;
}

vec3 along_plane(vec3 v, vec3 s, vec3 ahead) { return vec3(dot(v, cross(s, ahead)), dot(v, s), dot(v, ahead)); }

// The interface at the three places of a path's band. What its anchor does not have, none of the band has.
CrystalEvent crystal_event(Path path, Event event) {
    CrystalEvent met;
    met.normal = event.frame.normal;
    met.from_crystal = crystal_of(event.boundary.before) != NONE;
    met.to_crystal = crystal_of(event.boundary.after) != NONE;
    met.is_extraordinary = met.from_crystal && path.extraordinary != 0u;
    vec3 normals[3] = vec3[](met.normal, met.normal, met.normal), waves[3];
    vec3 directions[3] = vec3[](path.direction, path.direction, path.direction);
    if (SPECTRAL_GROUPS > 0 && path.restricted != 0u) {
        directions[0] = direction_at_end(path, 0);
        directions[2] = direction_at_end(path, 1);
        if (SPECTRAL_SWEEP) {
            normals[0] = event.end_normal[0];
            normals[2] = event.end_normal[1];
        } else {
            for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
                normals[0] += variable_step(uint(g), path.band.x, path.band.y) * NORMAL_COLUMN(event, SPATIAL + g);
                normals[2] += variable_step(uint(g), path.band.z, path.band.y) * NORMAL_COLUMN(event, SPATIAL + g);
            }
            normals[0] = normalize(normals[0]);
            normals[2] = normalize(normals[2]);
        }
    }
    vec3 upright = met.from_crystal ? across_direction(met.normal) : path.polarisation.axis;
    for (int i = 0; i < 3; ++i) {
        Uniaxial before = uniaxial_at(event.boundary.before, path.band[i], normals[i]);
        waves[i] = wave_of_ray(before, met.is_extraordinary, directions[i]);
        met.s[i] = incidence_axis(normalize(waves[i]), normals[i], upright);
    }
    vec4 light = met.is_extraordinary ? vec4(0.0, 1.0, 0.0, 0.0) : vec4(1.0, 0.0, 0.0, 0.0);
    Polarisation seen = in_plane(path.polarisation, path.direction, met.s);
    for (int i = 0; i < 3; ++i) {
        Uniaxial before = uniaxial_at(event.boundary.before, path.band[i], normals[i]),
                 behind = uniaxial_at(event.boundary.after, path.band[i], normals[i]);
        float n = met.is_extraordinary ? length(waves[i]) : before.n_o, ahead = min(dot(waves[i], normals[i]), -1e-6);
        vec2 left = (vec2(before.n_o, behind.n_o) - n) * (vec2(before.n_o, behind.n_o) + n) + ahead * ahead;
        before.axis = along_plane(before.axis, met.s[i], -normals[i]);
        behind.axis = along_plane(behind.axis, met.s[i], -normals[i]);
        if (!met.from_crystal) light = 0.5 * vec4(1.0 + seen.q[i], 1.0 - seen.q[i], seen.u[i], seen.v[i]);
        cross_interface(before, behind, length(waves[i] - ahead * normals[i]), left, light, met.back[i], met.onward[i]);
    }
    for (uint lobe = 0u; lobe < MOST_LOBES; ++lobe) {
        if (turn_wave(met, event, lobe, path.direction, met.normal, path.band.y).exists) continue;
        bool onward = (lobe & LOBE_ONWARD) != 0u;
        vec4 kept = (lobe & LOBE_EXTRAORDINARY) != 0u ? vec4(1.0, 0.0, 0.0, 0.0) : vec4(0.0, 1.0, 0.0, 0.0);
        for (int i = 0; i < 3; ++i) {
            met.back[i] *= onward ? vec4(1.0) : kept;
            met.onward[i] *= onward ? kept : vec4(1.0);
        }
    }
    for (int i = 0; i < 3; ++i) {
        float all = met.back[i].x + met.back[i].y + met.onward[i].x + met.onward[i].y;
        met.back[i] /= max(all, 1e-20);
        met.onward[i] /= max(all, 1e-20);
    }
    return met;
}

// The path turned into a lobe. `geometric`: the facet's normal had to judge.
void turn_crystal(inout Path path, Event event, CrystalEvent met, uint lobe, out bool geometric) {
    bool onward = (lobe & LOBE_ONWARD) != 0u, extraordinary = (lobe & LOBE_EXTRAORDINARY) != 0u,
         in_crystal = onward ? met.to_crystal : met.from_crystal;
    TurnedWave wave = turn_wave(met, event, lobe, path.direction, met.normal, path.band.y);
    geometric = wave.geometric;
    uint before = event.boundary.before, behind = onward ? event.boundary.after : before;
    for (int c = 0; c < PATH_COLUMNS; ++c) {
        vec2 slopes_before = vec2(0.0), slopes_behind = vec2(0.0);
        if (SPECTRAL_GROUPS > 0 && c >= SPATIAL && c < SPATIAL + SPECTRAL_GROUPS) {
            slopes_before = uniaxial_slopes(before, uint(c - SPATIAL), path.band.y);
            slopes_behind = uniaxial_slopes(behind, uint(c - SPATIAL), path.band.y);
        }
        vec3 dwave = wave_column(wave.before, slopes_before, met.is_extraordinary, path.direction, path.ddirection[c]);
        path.ddirection[c] = turned_column(wave.behind, slopes_behind, extraordinary, wave.incident, dwave, wave.turned,
            wave.normal, geometric ? vec3(0.0) : NORMAL_COLUMN(event, c));
    }
    if (SPECTRAL_SWEEP) {
        for (int end = 0; end < 2; ++end) {
            vec3 position_l, direction_l;
            linear_end(path, end, position_l, direction_l);
            TurnedWave at_end = turn_wave(met, event, lobe, path.end_direction[end],
                geometric ? wave.normal : event.end_normal[end], end == 0 ? path.band.x : path.band.z);
            path.end_direction[end] =
                at_end.exists && at_end.geometric == geometric ? normalize(at_end.energy) : direction_l;
        }
    }
    path.direction = normalize(wave.energy);
    path.extraordinary = uint(in_crystal && extraordinary);
    if (onward) path.medium = event.boundary.behind;
    path.polarisation = unpolarised(path.direction);
    if (!in_crystal) {
        vec4 low = onward ? met.onward[0] : met.back[0], anchor = onward ? met.onward[1] : met.back[1],
             high = onward ? met.onward[2] : met.back[2];
        vec3 first = vec3(low.x, anchor.x, high.x), second = vec3(low.y, anchor.y, high.y),
             per_share = 1.0 / max(first + second, 1e-20);
        path.polarisation = out_of_plane(
            Polarisation(met.s[1], (first - second) * per_share, 2.0 * vec3(low.z, anchor.z, high.z) * per_share,
                2.0 * vec3(low.w, anchor.w, high.w) * per_share),
            path.direction, met.s);
    }
}
