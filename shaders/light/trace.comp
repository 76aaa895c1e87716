// One specular event for every ray in flight: to the nearest surface, then reflection and
// refraction with all derivative columns. A ray leaves at most two children (or one photon on a
// receiver) in slots of its own; `queue_*.comp` list the living ones in order for the next call, so
// results do not depend on how threads were scheduled.
layout(local_size_x = 64) in;

#include "lib/intersect.glsl"
#include "lib/optics.glsl"
#include "lib/random.glsl"
#include "lib/medium.glsl"

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { TraceParameters p; };
layout(std430, binding = BIND_RAYS_IN) readonly restrict buffer RaysIn { uvec4 rays_in[]; };
layout(std430, binding = BIND_RAYS_OUT) writeonly restrict buffer RaysOut { uvec4 rays_out[]; };
layout(std430, binding = BIND_OUTCOMES) writeonly restrict buffer Outcomes { uvec4 outcomes[]; };
layout(std430, binding = BIND_PHOTON_SLOTS) writeonly restrict buffer PhotonSlots { uvec4 photon_slots[]; };
layout(std430, binding = BIND_INDICES) readonly restrict buffer Indices { uint indices[]; };
layout(std430, binding = BIND_STATE) readonly restrict buffer StateBlock { QueueState state; };

#define DEPOSITED (0u << 16)
#define ABSORBED (1u << 16)
#define ESCAPED (2u << 16)
#define DIRECT (3u << 16)
#define LOST_DEPTH (4u << 16)
#define LOST_NUMERIC (5u << 16)

#define FELL_FOOTPRINT (1u << 8)
#define FELL_NORMAL (1u << 9)
#define FELL_BAND (1u << 10)

#ifdef FOOTPRINTS
#define SPATIAL 2
#else
#define SPATIAL 0
#endif

// Survivors of roulette are only nearly a lattice: wider footprints keep their unevenness unseen.
#define SURVIVOR_SOFTNESS 1.5

// Narrower bands are not cut at total internal reflection.
#define MIN_CUT_BAND 1e-4
// GPU units that a cut may move a ray's start.
#define MAX_MOVED_START 0.01

// A column longer than this (GPU units, the glass is about 1) has left the linear regime for good.
#define COLUMN_LIMIT 1e6

// Share of a ray's power that must remain for a child to be followed for certain; weaker ones play
// roulette. Roulette's numbers are a Kronecker sequence in the photon's number, so survivors are
// again close to a lattice.
bool survives(inout RayRecord ray, inout float roulette_w, float share, uint branch)
{
    ray.survival *= share;
    ray.branch_key = hash_combine(ray.branch_key, branch);
    float chance = ray.survival / p.split_threshold;
    // What a first surface throws back is seen all round the glass: it keeps its whole lattice.
    if (chance >= 1.0 || ray.depth == 1u) return true;
    // One irrational a depth: the square roots of primes, as far from rational as from the lattice's golden ratio.
    // Deeper ones are hashed: with one that comes again, a path's later draws would follow from its earlier ones.
    // The count is that of the sub-lattice's own points: a multiple of an irrational may be a poor one.
    const uint generators[8] = uint[](1779033703u, 3144134277u, 2773480763u, 1359893119u, 2600822925u, 528734635u, 1541459225u, 3418070365u);
    uint generator = ray.depth < 8u ? generators[ray.depth] : hash_pcg(ray.depth) | 1u;
    float draw = kronecker(ray.photon_id / p.lattices, generator, ray.branch_key + (ray.photon_id % p.lattices) * 2654435769u);
    if (draw >= chance) {
        roulette_w += ray.flux_w;
        return false;
    }
    float boost = 1.0 / max(chance, 1e-30);
    roulette_w -= ray.flux_w * (boost - 1.0);
    ray.flux_w *= boost;
    ray.throughput *= boost;
    ray.footprint_scale *= SURVIVOR_SOFTNESS * sqrt(boost);
    ray.survival = p.split_threshold;
    return true;
}

#if SPECTRAL_GROUPS > 0
// Change of group g's variable from the anchor to x.
float variable_step(uint g, float x, float x_anchor)
{
    return spectral_row(uint(VARIABLE_ROW) + g, x) - spectral_row(uint(VARIABLE_ROW) + g, x_anchor);
}

// The same ray at another wavelength of its band: position and direction follow the spectral
// columns, weights are interpolated.
void anchor_at(inout RayRecord ray, float lo, float hi)
{
    float x = 0.5 * (lo + hi);
    vec3 band = vec3(ray.x_lo, ray.x_anchor, ray.x_hi), weight = ray.throughput;
    vec3 at = vec3(lo, x, hi);
    vec3 below = clamp((at - band.x) / max(band.y - band.x, 1e-9), 0.0, 1.0);
    vec3 above = clamp((at - band.y) / max(band.z - band.y, 1e-9), 0.0, 1.0);
    ray.throughput = mix(mix(vec3(weight.x), vec3(weight.y), below), vec3(weight.z), above);
    for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
        float change = variable_step(uint(g), x, ray.x_anchor);
        ray.position += change * ray.dposition[SPATIAL + g].xyz;
        ray.direction += change * ray.ddirection[SPATIAL + g].xyz;
    }
    ray.direction = normalize(ray.direction);
    ray.x_lo = lo;
    ray.x_hi = hi;
    ray.x_anchor = x;
}
#endif

RayRecord load_ray(uint slot)
{
    uvec4 texels[RayRecord_TEXELS];
    for (uint i = 0u; i < uint(RayRecord_TEXELS); ++i) texels[i] = rays_in[slot * uint(RayRecord_TEXELS) + i];
    return RayRecord_of(texels);
}

void store_ray(uint slot, RayRecord ray)
{
    uvec4 texels[RayRecord_TEXELS];
    to_texels(ray, texels);
    for (uint i = 0u; i < uint(RayRecord_TEXELS); ++i) rays_out[slot * uint(RayRecord_TEXELS) + i] = texels[i];
}

void store_photon(uint slot, PhotonRecord photon)
{
    uvec4 texels[PhotonRecord_TEXELS];
    to_texels(photon, texels);
    for (uint i = 0u; i < uint(PhotonRecord_TEXELS); ++i) photon_slots[slot * uint(PhotonRecord_TEXELS) + i] = texels[i];
}

void main()
{
    uint k = gl_GlobalInvocationID.x;
    if (k >= state.alive) return;
    RayRecord ray = load_ray(indices[k]);
#ifdef BAND_CUTS
    RayRecord whole = ray;
#endif
    Outcome outcome = Outcome(0u, 0.0, 0.0, 0.0);

    RayOrigin origin = RayOrigin(ray.last_primitive, ray.last_object, (ray.flags & FLAG_INSIDE) != 0u, ray.inside_mask);
    Hit hit;
    bool met = intersect_closest(ray.position, ray.direction, FAR_DISTANCE, origin, hit);
#ifdef LOOPS_MAY_END
    // llvmpipe ends every loop of an invocation once they have run 65,535 rounds together, and goes on with what there is.
    uint rounds = 0u;
    while (rounds < 2u) rounds += min(p.lattices, 1u);
    if (rounds < 2u) {
        outcomes[k] = uvec4(LOST_NUMERIC, floatBitsToUint(ray.flux_w), 0u, 0u);
        return;
    }
#endif
    float theta_g = dot(ray.direction, hit.normal_g);
    // Looked up once for all branches; some object and facet where nothing was met.
    uint object = met ? hit.object : 0u;
    Object thing = object_at(object);
    uint kind = met ? thing.kind : NONE;
#ifdef LOOSE_TRIANGLES
    Triangle facet = hit_triangle(hit);
#endif

#ifdef ABSORPTION
    {
        uint row = medium_weight_row(ray);
        if (row != NONE && met) {
            vec3 x3 = vec3(ray.x_lo, ray.x_anchor, ray.x_hi);
            vec3 alpha = vec3(spectral_row(uint(WEIGHT_ROW) + row, x3.x), spectral_row(uint(WEIGHT_ROW) + row, x3.y), spectral_row(uint(WEIGHT_ROW) + row, x3.z));
            vec3 kept = exp(-alpha * hit.distance);
            outcome.absorbed_w += ray.flux_w * (1.0 - kept.y);
            ray.flux_w *= kept.y;
            ray.throughput *= kept;
            ray.survival *= kept.y;
        }
    }
#endif

    // Move to the surface; a triangle's own coordinates place the point on it better than the ray does.
    vec3 start = ray.position;
    vec3 normal = hit.normal_g;
#ifdef SMOOTH_NORMALS
    vec3 summed;
    bool smooth_facet = false;
#endif
    if (met) {
        ray.position = start + hit.distance * ray.direction;
#ifdef CONVEX_SOLIDS
        if ((hit.primitive & PLANE_BIT) != 0u) {
            vec4 plane = planes[hit.primitive & ~PLANE_BIT];
            ray.position -= plane.xyz * (dot(ray.position, plane.xyz) - plane.w);
        } else
#endif
        {
#ifdef LOOSE_TRIANGLES
            ray.position = facet.vertex + hit.bary.x * facet.edge1 + hit.bary.y * facet.edge2;
#ifdef SMOOTH_NORMALS
            if (facet.normals != NONE) {
                smooth_facet = true;
                summed = (1.0 - hit.bary.x - hit.bary.y) * corner_normal(facet.normals)
                       + hit.bary.x * corner_normal(facet.normals + 1u) + hit.bary.y * corner_normal(facet.normals + 2u);
                normal = normalize(summed);
            }
#endif
#endif
        }
    }
#if COLUMNS > 0
    for (int c = 0; c < COLUMNS; ++c)
        ray.dposition[c].xyz = transfer_column(ray.dposition[c].xyz, ray.ddirection[c].xyz, ray.direction, hit.normal_g, hit.distance);
#endif

    if (kind == KIND_DIFFUSE) {
        outcome.what |= ray.depth == 0u ? DIRECT : DEPOSITED;
        outcome.flux_w = ray.flux_w;
        if (ray.depth > 0u) {
            PhotonRecord photon;
            photon.position = ray.position;
            photon.flux_w = ray.flux_w;
            photon.dposition_ds = vec3(0.0);
            photon.dposition_dt = vec3(0.0);
#ifdef FOOTPRINTS
            photon.dposition_ds = ray.dposition[0].xyz * ray.footprint_scale;
            photon.dposition_dt = ray.dposition[1].xyz * ray.footprint_scale;
#endif
            photon.x_lo = ray.x_lo;
            photon.x_hi = ray.x_hi;
            photon.throughput = ray.throughput;
            photon.x_anchor = ray.x_anchor;
#ifdef LOOSE_TRIANGLES
            photon.triangle = facet.source;
#endif
            photon.receiver = thing.receiver;
            photon.photon_id = ray.photon_id;
            photon.light_and_source = ray.light_and_source;
            photon.branch_key = ray.branch_key;
            photon.depth = ray.depth;
            photon.cosine = abs(theta_g);
#if SPECTRAL_GROUPS > 0
            SPECTRAL_COPY
#endif
            float largest = 0.0;
#if COLUMNS > 0
            for (int c = 0; c < COLUMNS; ++c)
                largest = max(largest, dot(ray.dposition[c].xyz, ray.dposition[c].xyz));
#endif
            // Not (x < limit) is also true for NaN.
            if (!(largest < COLUMN_LIMIT * COLUMN_LIMIT)) {
                ray.flags |= FLAG_FOOTPRINT_DROPPED;
                outcome.what |= FELL_FOOTPRINT;
            }
            photon.flags = ray.flags & FLAG_FOOTPRINT_DROPPED;
            store_photon(k, photon);
            outcome.what |= 4u;
        }
    } else if (kind == KIND_BLACK) {
        outcome.what |= ABSORBED;
        outcome.flux_w = ray.flux_w;
    } else if (kind == NONE) {
        // A ray that leaves the scene from inside a solid slipped through a crack.
        outcome.what |= ray_is_inside(ray) ? LOST_NUMERIC : ESCAPED;
        outcome.flux_w = ray.flux_w;
    } else if (ray.depth >= p.max_depth) {
        outcome.what |= LOST_DEPTH;
        outcome.flux_w = ray.flux_w;
    } else {
        bool entering = theta_g < 0.0;
        vec3 normal_g = entering ? hit.normal_g : -hit.normal_g;
        theta_g = -abs(theta_g);
        normal = entering ? normal : -normal;
        float theta = dot(ray.direction, normal);
#ifdef SMOOTH_NORMALS
        // The geometric normal judges: a shading normal that sees the ray from behind is not used.
        if (smooth_facet && !(theta < -1e-6)) {
            normal = normal_g;
            theta = theta_g;
            smooth_facet = false;
            outcome.what |= FELL_NORMAL;
        }
#endif
        if ((ray.light_and_source >> 16) == 0xffffu)
            ray.light_and_source = (ray.light_and_source & 0xffffu) | (object << 16);

#ifdef NORMAL_DERIVATIVES
        vec3 normal_columns[COLUMNS];
        for (int c = 0; c < COLUMNS; ++c) normal_columns[c] = vec3(0.0);
        if (smooth_facet) {
            vec3 gradient_u, gradient_v;
            barycentric_gradients(facet.edge1, facet.edge2, gradient_u, gradient_v);
            vec3 n0 = corner_normal(facet.normals), n1 = corner_normal(facet.normals + 1u), n2 = corner_normal(facet.normals + 2u);
            float sign_n = entering ? 1.0 : -1.0;
            for (int c = 0; c < COLUMNS; ++c) {
                vec3 dp = ray.dposition[c].xyz;
                vec3 dsummed = dot(gradient_u, dp) * (n1 - n0) + dot(gradient_v, dp) * (n2 - n0);
                normal_columns[c] = sign_n * normalised_derivative(summed, dsummed);
            }
        }
#define NORMAL_COLUMN(c) normal_columns[c]
#else
#define NORMAL_COLUMN(c) vec3(0.0)
#endif
        uint kept_flags = ray.flags & FLAG_FOOTPRINT_DROPPED;
        // Each child is stored in one place, whichever event made it: where every branch is executed, every
        // store costs even when no ray takes it.
        RayRecord child = ray;
        bool lives = false;
        child.last_primitive = hit.primitive;
        child.last_object = object;
        child.flags = kept_flags | (entering ? 0u : FLAG_INSIDE);
        child.depth = ray.depth + 1u;

#ifdef HAS_MIRROR
        if (kind == KIND_MIRROR) {
            uint row = uint(WEIGHT_ROW) + thing.weight_row;
            vec3 kept = vec3(spectral_row(row, ray.x_lo), spectral_row(row, ray.x_anchor), spectral_row(row, ray.x_hi));
            outcome.what |= ABSORBED;
            outcome.flux_w = ray.flux_w * (1.0 - kept.y);
            child.flux_w *= kept.y;
            child.throughput *= kept;
            child.direction = normalize(reflect_direction(ray.direction, normal, theta));
#if COLUMNS > 0
            for (int c = 0; c < COLUMNS; ++c)
                child.ddirection[c].xyz = reflect_column(ray.direction, ray.ddirection[c].xyz, normal, NORMAL_COLUMN(c), theta);
#endif
            lives = survives(child, outcome.roulette_w, kept.y, 3u);
        }
#endif
#ifdef HAS_DIELECTRIC
        MediumInterface crossing = cross_boundary(ray, object, entering);
        bool splits = kind == KIND_DIELECTRIC && crossing.changes, cut = false;
        vec3 theta3 = vec3(theta), n_i, n_t;
#ifdef SPECTRAL_WEIGHTS
        vec3 x3 = vec3(ray.x_lo, ray.x_anchor, ray.x_hi);
#if SPECTRAL_GROUPS > 0
        for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
            float dtheta = dot(ray.ddirection[SPATIAL + g].xyz, normal) + dot(ray.direction, NORMAL_COLUMN(SPATIAL + g));
            theta3.x += dtheta * variable_step(uint(g), x3.x, x3.y);
            theta3.z += dtheta * variable_step(uint(g), x3.z, x3.y);
        }
        theta3.xz = clamp(theta3.xz, -1.0, -1e-6);
#endif
        crossing_indices(crossing, x3, n_i, n_t);
#else
        n_i = vec3(medium_index(crossing.before, ray.x_anchor));
        n_t = vec3(medium_index(crossing.after, ray.x_anchor));
#endif
        vec3 eta3 = n_i / n_t;
        vec3 cosine2 = transmitted_cosine2(theta3, eta3);
        vec3 reflectance = fresnel_reflectance(theta3, eta3, cosine2);
#ifdef ANCHOR_WEIGHTS
        reflectance = vec3(reflectance.y);
#endif
        float eta_it = eta3.y, through = 1.0 - reflectance.y;
#ifdef BAND_CUTS
        bvec3 passes = greaterThan(cosine2, vec3(0.0));
        cut = splits && any(passes) && !all(passes) && (ray.flags & FLAG_BAND_FINAL) == 0u && ray.x_hi - ray.x_lo > MIN_CUT_BAND;
        float at = 0.0, share = 0.0;
        if (cut) {
            // Total internal reflection sets in inside the band: find where, and let both parts
            // meet this surface again, each anchored in its own middle.
            bool low_side = passes.x != passes.y;
            float a = low_side ? x3.x : x3.y, b = low_side ? x3.y : x3.z;
            bool passes_a = low_side ? passes.x : passes.y;
            for (int i = 0; i < 22; ++i) {
                float x = 0.5 * (a + b);
                float theta_x = theta;
                for (int g = 0; g < SPECTRAL_GROUPS; ++g)
                    theta_x += (dot(ray.ddirection[SPATIAL + g].xyz, normal) + dot(ray.direction, NORMAL_COLUMN(SPATIAL + g))) * variable_step(uint(g), x, ray.x_anchor);
                float eta_x = medium_index(crossing.before, x) / medium_index(crossing.after, x);
                bool passes_x = transmitted_cosine2(clamp(theta_x, -1.0, -1e-6), eta_x) > 0.0;
                a = passes_x == passes_a ? x : a;
                b = passes_x == passes_a ? b : x;
            }
            at = 0.5 * (a + b);
            // A sliver of a band is not worth a path of its own.
            cut = min(at - ray.x_lo, ray.x_hi - at) > 0.01 * MIN_CUT_BAND;
            // Nor is a start moved so far along the columns that it may lie beyond another surface.
            vec3 to_low = vec3(0.0), to_high = vec3(0.0);
            for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
                to_low += variable_step(uint(g), 0.5 * (ray.x_lo + at), ray.x_anchor) * whole.dposition[SPATIAL + g].xyz;
                to_high += variable_step(uint(g), 0.5 * (at + ray.x_hi), ray.x_anchor) * whole.dposition[SPATIAL + g].xyz;
            }
            float longest = max(dot(to_low, to_low), dot(to_high, to_high));
            float allowed = min(MAX_MOVED_START, 0.1 * hit.distance);
            cut = cut && longest < allowed * allowed;
        }
        if (cut) {
            float power_lo = spectral_row(uint(p.power_row), ray.x_lo), power_at = spectral_row(uint(p.power_row), at), power_hi = spectral_row(uint(p.power_row), ray.x_hi);
            share = clamp((power_at - power_lo) / max(power_hi - power_lo, 1e-30), 0.0, 1.0);
            // Back to the start of the flight: the surface is met again next time.
            whole.flags |= FLAG_BAND_FINAL;
            outcome.absorbed_w = 0.0;
            outcome.what |= FELL_BAND;
            child = whole;
            anchor_at(child, whole.x_lo, at);
            child.flux_w = whole.flux_w * share;
            // Roulette counts by power, also where a band was only divided: or cuts would breed.
            child.survival = whole.survival * share;
            child.branch_key = hash_combine(whole.branch_key, 5u);
            lives = true;
        }
#endif
        if (splits && !cut) {
            bool geometric = dot(reflect_direction(ray.direction, normal, theta), normal_g) <= 0.0;
            vec3 facing_n = geometric ? normal_g : normal;
            float facing_theta = geometric ? theta_g : theta;
            child.flux_w = ray.flux_w * reflectance.y;
            child.throughput = ray.throughput * reflectance;
            child.direction = normalize(reflect_direction(ray.direction, facing_n, facing_theta));
#if COLUMNS > 0
            for (int c = 0; c < COLUMNS; ++c)
                child.ddirection[c].xyz = reflect_column(ray.direction, ray.ddirection[c].xyz, facing_n, geometric ? vec3(0.0) : NORMAL_COLUMN(c), facing_theta);
#endif
            outcome.what |= geometric ? FELL_NORMAL : 0u;
            lives = child.flux_w > 0.0 && survives(child, outcome.roulette_w, reflectance.y, 1u);
        }
        if (kind == KIND_DIELECTRIC && !crossing.changes) {
            // Another solid decides here: walk through, only remember where we are.
            child.flags = kept_flags | (entering ? FLAG_INSIDE : 0u);
            child.depth = ray.depth;
            child.inside_mask = crossing.mask_after;
            lives = true;
        }
#endif
        if (lives) {
            store_ray(2u * k, child);
            outcome.what |= 1u;
        }

#ifdef HAS_DIELECTRIC
        child = ray;
        lives = false;
#ifdef BAND_CUTS
        if (cut) {
            child = whole;
            anchor_at(child, at, whole.x_hi);
            child.flux_w = whole.flux_w * (1.0 - share);
            child.survival = whole.survival * (1.0 - share);
            child.branch_key = hash_combine(whole.branch_key, 6u);
            lives = true;
        }
#endif
        if (splits && !cut && cosine2.y > 0.0) {
            float omega = sqrt(cosine2.y);
            vec3 direction_t = refract_direction(ray.direction, normal, theta, eta_it, omega);
            vec3 facing_n = normal;
            float facing_theta = theta;
            bool geometric = dot(direction_t, normal_g) >= 0.0;
            if (geometric) {
                facing_n = normal_g;
                facing_theta = theta_g;
                omega = sqrt(max(transmitted_cosine2(theta_g, eta_it), 1e-12));
                direction_t = refract_direction(ray.direction, normal_g, theta_g, eta_it, omega);
                outcome.what |= FELL_NORMAL;
            }
            child.direction = normalize(direction_t);
            child.flux_w = ray.flux_w * through;
            child.throughput = ray.throughput * (1.0 - reflectance);
            child.last_primitive = hit.primitive;
            child.last_object = object;
            child.flags = kept_flags | (entering ? FLAG_INSIDE : 0u);
            child.depth = ray.depth + 1u;
            child.inside_mask = crossing.mask_after;
            child.inside_object = crossing.object_after;
#if COLUMNS > 0
            for (int c = 0; c < COLUMNS; ++c) {
                float deta_it = 0.0;
#if SPECTRAL_GROUPS > 0
                if (c >= SPATIAL)
                    deta_it = index_ratio_derivative(crossing, uint(c - SPATIAL), ray.x_anchor, n_i.y, n_t.y);
#endif
                child.ddirection[c].xyz = refract_column(ray.direction, ray.ddirection[c].xyz, facing_n, geometric ? vec3(0.0) : NORMAL_COLUMN(c), facing_theta, eta_it, omega, deta_it);
            }
#endif
            lives = survives(child, outcome.roulette_w, through, 2u);
        }
        if (lives) {
            store_ray(2u * k + 1u, child);
            outcome.what |= 2u;
        }
#endif
    }
    uvec4 texels[Outcome_TEXELS];
    to_texels(outcome, texels);
    outcomes[k] = texels[0];
}
