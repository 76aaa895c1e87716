// Emission: one thread a lattice point. Compiled once per kind of light (LIGHT_POINT covers spots,
// LIGHT_PROFILE lamps from photometric files, LIGHT_PLANE directional and collimated light, LIGHT_AREA area lights);
// THINNED_CELLS where emission is guided (app/passes/guided_emission.py).
layout(local_size_x = 64) in;

#include "lib/emission.glsl"
#include "lib/spot.glsl"
#include "lib/edge.glsl"
#include "lib/wavelength.glsl"
#include "lib/profile.glsl"
#include "lib/polarisation.glsl"

layout(std430, binding = BIND_PARAMETERS) readonly restrict buffer Parameters { EmitParameters p; };
layout(std430, binding = BIND_RAYS_OUT) writeonly restrict buffer RaysOut { uvec4 rays[]; };
layout(std430, binding = BIND_INDICES) readonly restrict buffer Order { uint order[]; };
#ifdef RAY_POOL
#include "lib/pool.glsl"
shared uint group_rays, group_first;

// In the pool; of what is emitted without gaps.
uint emitted_slot(bool alive) {
    bool is_first = gl_LocalInvocationIndex == 0u;
    if (is_first) group_rays = 0u;
    barrier();
    uint rank = alive ? atomicAdd(group_rays, 1u) : 0u;
    barrier();
    if (is_first) group_first = atomicAdd(state.taken, group_rays);
    if (is_first) atomicAdd(state.emitted, group_rays);
    barrier();
    return group_first + rank;
}
#else
layout(std430, binding = BIND_OUTCOMES) writeonly restrict buffer Outcomes { uvec4 outcomes[]; };
#endif

vec3 to_world(vec3 local) { return local.x * p.tangent + local.y * p.bitangent + local.z * p.axis; }

#define STORE_RAY(at, texel) rays[at] = texel

void main() {
    uint k = gl_GlobalInvocationID.x;
    bool is_there = k < p.count;
    if (!RAY_POOL && !is_there) return;
    // Every band, and every point on an extended light, has a regular lattice of its own, shifted
    // against the others: a lattice whose points jittered over the light would be noise.
    uint lattices = p.band_count * p.light_points;
    // One sub-lattice after the other, its points along a curve that keeps neighbours together.
    uint points = p.count / lattices;
    uint sub = k / points;
    // The points of a last block that is not whole keep their places.
    uint at = k % points, block = uint(order.length()), within = at % block;
    uint point = p.first + (at - within + block <= points ? at - within + order[within] : at) * p.stride;
    uint id = point * lattices + sub;
    uint band_index = sub % p.band_count;
    vec4 band = p.bands[band_index];
    Outcome outcome = Outcome(0u, 0.0, 0.0, 0.0);

    // Where wavelengths do not part, all bands share one lattice: or its ripple would be coloured.
    uint own_lattice = SPECTRAL_GROUPS > 0 ? sub : sub / p.band_count;
    vec2 unit = lattice_point(point, p.lattice_count, p.shift + own_lattice * uvec2(PLASTIC_1, PLASTIC_2));
    uvec2 cell = uvec2(unit * float(MASK_SIZE));
    uint bit = min(cell.y, uint(MASK_SIZE - 1)) * uint(MASK_SIZE) + min(cell.x, uint(MASK_SIZE - 1));
    bool alive = (p.mask[bit >> 5u] & (1u << (bit & 31u))) != 0u;
    vec2 q = p.rect.xy + unit * p.rect.zw;
    uint place = sub / p.band_count;
    vec2 on_disc = p.light_points > 1u ? mirrored_lattice_point(place, p.light_points, p.shift_light) : p.light_place;

    vec3 position, direction, dposition_ds = vec3(0.0), dposition_dt = vec3(0.0), ddirection_ds = vec3(0.0),
                              ddirection_dt = vec3(0.0);
    float weight = p.weight;
    // A lattice that is cut off sharply would leave a saw-toothed edge.
    float spacings = EDGE_REACH;
    vec2 to_lit = vec2(0.0);
#ifdef THINNED_CELLS
    // Few points of a cell from which a pilot's light landed nowhere stand for all of them. Roulette on the way has the
    // generators from 1 on.
    bool is_thinned = (p.thinned[bit >> 5u] & (1u << (bit & 31u))) != 0u;
    alive = alive
        && (!is_thinned
            || kronecker(point, depth_generator(0u), p.seed + own_lattice * 2654435769u) < p.thinned_chance);
    float stands_for = is_thinned ? 1.0 / p.thinned_chance : 1.0;
    weight *= stands_for;
#endif
    if (!LIGHT_PLANE) {
        alive = alive && dot(q, q) < 4.0;
        vec3 dx, dy;
        direction = to_world(azimuthal_direction(q, dx, dy));
        ddirection_ds = p.spacing.x * to_world(dx);
        ddirection_dt = p.spacing.y * to_world(dy);
        position = p.origin;
        if (!LIGHT_AREA) {
            if (p.cone.y - p.cone.x > 1e-7) {
                weight *= spot_falloff(direction, p.light_axis, p.cone);
            } else if (p.cone.y < 3.1415926) {
                float angle = angle_between(direction, p.light_axis);
                to_lit =
                    vec2(dot(ddirection_ds, p.light_axis), dot(ddirection_dt, p.light_axis)) / max(sin(angle), 1e-6);
                spacings = spacings_inside(p.cone.y - angle, to_lit);
            }
            if (LIGHT_PROFILE) weight *= profile_intensity(p.profile, direction, p.light_axis, p.light_u, p.light_v);
        } else {
            vec2 on_light = p.is_disc != 0u ? concentric_disc(on_disc) : 2.0 * on_disc - 1.0;
            position += on_light.x * p.light_u + on_light.y * p.light_v;
            weight *= max(dot(direction, p.light_axis), 0.0);
        }
    } else {
        bool is_window = p.cone.y > 0.0;
        vec2 tilt = is_window ? (2.0 * on_disc - 1.0) * p.cone : concentric_disc(on_disc) * p.cone.x;
        direction = normalize(p.axis + tilt.x * p.tangent + tilt.y * p.bitangent);
        // Solid angle per area of the rectangle, and the cosine to the plane.
        if (is_window) weight *= pow(dot(direction, p.axis), 4.0);
        vec3 across = q.x * p.tangent + q.y * p.bitangent;
        position = p.origin + across - p.back * direction;
        dposition_ds = p.spacing.x * p.tangent;
        dposition_dt = p.spacing.y * p.bitangent;
        // A collimated beam ends at its aperture.
        vec3 off_axis = p.origin - p.aperture_centre + across;
        vec2 at = vec2(dot(off_axis, p.light_u), dot(off_axis, p.light_v));
        mat2 at_by_step = mat2(p.spacing.x * vec2(dot(p.tangent, p.light_u), dot(p.tangent, p.light_v)),
            p.spacing.y * vec2(dot(p.bitangent, p.light_u), dot(p.bitangent, p.light_v)));
        if (p.light_u != vec3(0.0)) {
            float from_middle = max(length(at), 1e-20);
            vec2 outwards[2] =
                vec2[](p.is_disc != 0u ? at / from_middle : vec2(sign(at.x), 0.0), vec2(0.0, sign(at.y)));
            vec2 change = -outwards[0] * at_by_step, across_change = -outwards[1] * at_by_step;
            spacings = spacings_inside(1.0 - dot(outwards[0], at), change);
            to_lit = change;
            if (p.is_disc == 0u) {
                // Beside a corner a footprint is cut by the nearer edge; the other one takes its share of all of it.
                float other = spacings_inside(1.0 - abs(at.y), across_change), first = spacings;
                spacings = min(first, other);
                to_lit = first < other ? change : across_change;
                weight *= lit_share(max(first, other));
            }
        }
    }
    weight *= lit_share(spacings);
    alive = alive && weight > 0.0;
    uint slot = 2u * k;
#ifdef RAY_POOL
    open_tally();
    alive = alive && is_there;
    slot = emitted_slot(alive);
    alive = alive && slot < state.capacity;
#endif
    if (alive) {
        RayRecord ray;
        ray.position = position;
        ray.direction = direction;
        ray.flux_w = weight * band.w;
        ray.footprint_scale = THINNED_CELLS ? sqrt(stands_for) : 1.0;
        ray.throughput = vec3(weight);
        ray.x_lo = band.x;
        ray.x_hi = band.y;
        ray.x_anchor = band.z;
        if (RANDOM_WAVELENGTH) {
            // By brightness within the band; a laser's band has no width, and its photons all have its wavelength.
            float place_in_band = EVEN_WAVELENGTHS
                ? drawn_evenly(id, lattices, p.shift_spectral)
                : unit_float(hash_combine(hash_combine(p.shift_spectral, p.light), id));
            float per_density = 1.0;
            if (band.y > band.x)
                ray.x_anchor = drawn_wavelength(uint(BRIGHTNESS_ROW) + p.light, band.xy, place_in_band, per_density);
            ray.x_lo = ray.x_anchor;
            ray.x_hi = ray.x_anchor;
            ray.throughput *= per_density;
            if (HERO) {
                // The hero's path is shared by three wavelengths a quarter of all draws on each [Wilkie et al. 2014].
                // Any of the four would have led to it, so each has a quarter of its weight (balance heuristic; all
                // that roulette asks is the same for all four).
                ray.companion_x = vec4(0.0);
                ray.companion_throughput = vec4(0.0);
                if (band.y > band.x) {
                    for (int i = 0; i < 3; ++i) {
                        float x = drawn_wavelength(uint(BRIGHTNESS_ROW) + p.light, band.xy,
                            fract(place_in_band + 0.25 * float(i + 1)), per_density);
                        ray.companion_x[i] = x;
                        ray.companion_throughput[i] = 0.25 * weight * per_density;
                    }
                    ray.companion_x.w = 1.0;
                    ray.throughput *= 0.25;
                }
            }
        }
        if (POLARISED) {
            vec3 axis = across_direction(direction);
            ray.axis_x = axis.x;
            ray.axis_y = axis.y;
            ray.axis_z = axis.z;
            ray.stokes_q = ray.stokes_u = ray.stokes_v = vec3(0.0);
            if (HERO) ray.companion_q = ray.companion_u = ray.companion_v = vec4(0.0);
        }
        ray.survival = 1.0;
        ray.photon_id = id;
        ray.light_and_source = p.light | (band_index << 8u) | 0xffff0000u;
        ray.branch_key = hash_combine(p.seed, p.light * 4096u + band_index);
        ray.flags = 0u;
        ray.depth = 0u;
        ray.last_primitive = 0xffffffffu;
        ray.last_object = 0xffffffffu;
        ray.inside_mask = 0u;
        ray.inside_object = 0xffffffffu;
        if (FLIGHTS) ray.flown = vec4(0.0);
        if (TINT_LEVELS > 0) ray.tinted = vec4(0.0);
        if (COLUMNS > 0) {
            for (int c = 0; c < COLUMNS; ++c) {
                ray.dposition[c] = vec4(0.0);
                ray.ddirection[c] = vec4(0.0);
            }
        }
        if (FOOTPRINTS) {
            // Longer along the row of points that this one stands for. Edges are told for one of a lattice alone.
            bool is_row = p.row_s + p.row_t > 0.0;
            mat2 longer = mat2(1.0 + p.row_s, p.row_st, p.row_st, 1.0 + p.row_t);
            mat2x3 dposition = mat2x3(dposition_ds, dposition_dt) * longer;
            mat2x3 ddirection = mat2x3(ddirection_ds, ddirection_dt) * longer;
            ray.dposition[0] = vec4(dposition[0], 0.0);
            if (LIGHT_EDGES) ray.dposition[0].w = float(packed_edge(is_row ? EDGE_REACH : spacings, to_lit));
            ray.dposition[1].xyz = dposition[1];
            ray.ddirection[0].xyz = ddirection[0];
            ray.ddirection[1].xyz = ddirection[1];
        }
        if (LAMP_COLUMNS) {
            // Two axes of a normal distribution with the variance of the places that this point stands for on the
            // light.
#ifdef LIGHT_AREA
            float reach = p.lamp_step * (p.is_disc != 0u ? 0.5 : inversesqrt(3.0));
            ray.dposition[COLUMNS - 2].xyz = reach * p.light_u;
            ray.dposition[COLUMNS - 1].xyz = reach * p.light_v;
#endif
            if (LIGHT_PLANE) {
                vec2 reach = p.lamp_step * (p.cone.y > 0.0 ? inversesqrt(3.0) * p.cone : vec2(0.5 * p.cone.x));
                ray.ddirection[COLUMNS - 2].xyz = reach.x * (p.tangent - dot(p.tangent, direction) * direction);
                ray.ddirection[COLUMNS - 1].xyz = reach.y * (p.bitangent - dot(p.bitangent, direction) * direction);
                for (int c = COLUMNS - 2; c < COLUMNS; ++c) ray.dposition[c].xyz = -p.back * ray.ddirection[c].xyz;
            }
        }
        RayRecord_TO(STORE_RAY, slot * uint(RayRecord_TEXELS), ray) outcome.what = 1u | 8u;
        outcome.flux_w = ray.flux_w;
    }
#ifdef RAY_POOL
    count_watts(EMITTED_ROW, outcome.flux_w);
    close_group(true);
#else
    uvec4 texels[Outcome_TEXELS];
    to_texels(outcome, texels);
    outcomes[k] = texels[0];
#endif
}
