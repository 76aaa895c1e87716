// One specular event for every ray in flight: to the nearest surface, then reflection and
// refraction with all derivative columns. A ray leaves at most two children (or one photon on a
// receiver) in slots of its own; `compact_*.comp` list the living ones in order for the next call, so
// results do not depend on how threads were scheduled.
layout(local_size_x = 64) in;

#include "lib/intersect.glsl"
#include "lib/optics.glsl"
#include "lib/random.glsl"
#include "lib/medium.glsl"

layout(std430, binding = BIND_PARAMETERS) readonly restrict buffer Parameters { TraceParameters p; };
layout(std430, binding = BIND_RAYS_IN) readonly restrict buffer RaysIn { RayRecord rays_in[]; };
layout(std430, binding = BIND_RAYS_OUT) writeonly restrict buffer RaysOut { RayRecord rays_out[]; };
layout(std430, binding = BIND_OUTCOMES) writeonly restrict buffer Outcomes { Outcome outcomes[]; };
layout(std430, binding = BIND_PHOTON_SLOTS) writeonly restrict buffer PhotonSlots { PhotonRecord photon_slots[]; };
layout(std430, binding = BIND_INDICES) readonly restrict buffer Indices { uint indices[]; };
layout(std430, binding = BIND_STATE) readonly restrict buffer StateBlock { QueueState state; };

#define DEPOSITED 0u
#define ABSORBED 1u
#define ESCAPED 2u
#define DIRECT 3u
#define LOST_DEPTH 4u
#define LOST_NUMERIC 5u

#define FELL_FOOTPRINT (1u << 8)
#define FELL_NORMAL (1u << 9)
#define FELL_BAND (1u << 10)

#ifdef FOOTPRINTS
#define SPATIAL 2
#else
#define SPATIAL 0
#endif

// Narrower bands are not cut at total internal reflection.
#define MIN_CUT_BAND 1e-4

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
    if (chance >= 1.0) return true;
    float draw = kronecker(ray.photon_id, 3774877043u + 2u * (ray.depth * 668265263u), ray.branch_key);
    if (draw >= chance) {
        roulette_w += ray.flux_w;
        return false;
    }
    float boost = 1.0 / max(chance, 1e-30);
    roulette_w -= ray.flux_w * (boost - 1.0);
    ray.flux_w *= boost;
    ray.throughput *= boost;
    ray.footprint_scale *= sqrt(boost);
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

void main()
{
    uint k = gl_GlobalInvocationID.x;
    if (k >= state.alive) return;
    RayRecord ray = rays_in[indices[k]];
    Outcome outcome = Outcome(0u, ESCAPED, 0.0, 0.0, 0.0, 0.0);

    RayOrigin origin = RayOrigin(ray.last_primitive, ray.last_object, (ray.flags & FLAG_INSIDE) != 0u, ray.inside_mask);
    Hit hit;
    bool met = intersect_closest(ray.position, ray.direction, FAR_DISTANCE, origin, hit);
    float theta_g = dot(ray.direction, hit.normal_g);
    uint kind = met ? objects[hit.object].kind : NONE;

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
    vec3 normal = hit.normal_g, summed = vec3(0.0);
    bool smooth_facet = false;
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
            Triangle facet = triangles[hit.primitive];
            ray.position = facet.vertex + hit.bary.x * facet.edge1 + hit.bary.y * facet.edge2;
#ifdef SMOOTH_NORMALS
            if (facet.normals != NONE) {
                smooth_facet = true;
                summed = (1.0 - hit.bary.x - hit.bary.y) * corner_normals[facet.normals].xyz
                       + hit.bary.x * corner_normals[facet.normals + 1u].xyz + hit.bary.y * corner_normals[facet.normals + 2u].xyz;
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
        outcome.category = ray.depth == 0u ? DIRECT : DEPOSITED;
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
            photon.triangle = triangles[hit.primitive].source;
            photon.receiver = objects[hit.object].receiver;
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
            photon_slots[k] = photon;
            outcome.what |= 4u;
        }
    } else if (kind == KIND_BLACK) {
        outcome.category = ABSORBED;
        outcome.flux_w = ray.flux_w;
    } else if (kind == NONE) {
        // A ray that leaves the scene from inside a solid slipped through a crack.
        outcome.category = ray_is_inside(ray) ? LOST_NUMERIC : ESCAPED;
        outcome.flux_w = ray.flux_w;
    } else if (ray.depth >= p.max_depth) {
        outcome.category = LOST_DEPTH;
        outcome.flux_w = ray.flux_w;
    } else {
        bool entering = theta_g < 0.0;
        vec3 normal_g = entering ? hit.normal_g : -hit.normal_g;
        theta_g = -abs(theta_g);
        normal = entering ? normal : -normal;
        float theta = dot(ray.direction, normal);
        // The geometric normal judges: a shading normal that sees the ray from behind is not used.
        if (smooth_facet && !(theta < -1e-6)) {
            normal = normal_g;
            theta = theta_g;
            smooth_facet = false;
            outcome.what |= FELL_NORMAL;
        }
        if ((ray.light_and_source >> 16) == 0xffffu)
            ray.light_and_source = (ray.light_and_source & 0xffffu) | (hit.object << 16);

#if COLUMNS > 0
        vec3 dnormal[COLUMNS];
        for (int c = 0; c < COLUMNS; ++c) dnormal[c] = vec3(0.0);
#ifdef SMOOTH_NORMALS
        if (smooth_facet) {
            Triangle facet = triangles[hit.primitive];
            vec3 gradient_u, gradient_v;
            barycentric_gradients(facet.edge1, facet.edge2, gradient_u, gradient_v);
            vec3 n0 = corner_normals[facet.normals].xyz, n1 = corner_normals[facet.normals + 1u].xyz, n2 = corner_normals[facet.normals + 2u].xyz;
            float sign_n = entering ? 1.0 : -1.0;
            for (int c = 0; c < COLUMNS; ++c) {
                vec3 dp = ray.dposition[c].xyz;
                vec3 dsummed = dot(gradient_u, dp) * (n1 - n0) + dot(gradient_v, dp) * (n2 - n0);
                dnormal[c] = sign_n * normalised_derivative(summed, dsummed);
            }
        }
#endif
#endif
        Crossing crossing = cross_boundary(ray, hit.object, entering);
        RayRecord reflected = ray;
        reflected.last_primitive = hit.primitive;
        reflected.last_object = hit.object;
        reflected.flags = (ray.flags & FLAG_FOOTPRINT_DROPPED) | (entering ? 0u : FLAG_INSIDE);
        reflected.depth = ray.depth + 1u;

#ifdef HAS_MIRROR
        if (kind == KIND_MIRROR) {
            uint row = uint(WEIGHT_ROW) + objects[hit.object].weight_row;
            vec3 kept = vec3(spectral_row(row, ray.x_lo), spectral_row(row, ray.x_anchor), spectral_row(row, ray.x_hi));
            outcome.category = ABSORBED;
            outcome.flux_w = ray.flux_w * (1.0 - kept.y);
            reflected.flux_w *= kept.y;
            reflected.throughput *= kept;
            reflected.direction = normalize(reflect_direction(ray.direction, normal, theta));
#if COLUMNS > 0
            for (int c = 0; c < COLUMNS; ++c)
                reflected.ddirection[c].xyz = reflect_column(ray.direction, ray.ddirection[c].xyz, normal, dnormal[c], theta);
#endif
            if (survives(reflected, outcome.roulette_w, kept.y, 3u)) {
                rays_out[2u * k] = reflected;
                outcome.what |= 1u;
            }
        }
#endif
#ifdef HAS_DIELECTRIC
        if (kind == KIND_DIELECTRIC && !crossing.changes) {
            // Another solid decides here: walk through, only remember where we are.
            ray.last_primitive = hit.primitive;
            ray.last_object = hit.object;
            ray.flags = (ray.flags & FLAG_FOOTPRINT_DROPPED) | (entering ? FLAG_INSIDE : 0u);
            ray.inside_mask = crossing.mask_after;
            rays_out[2u * k] = ray;
            outcome.what |= 1u;
        } else if (kind == KIND_DIELECTRIC) {
            vec3 theta3 = vec3(theta);
#ifdef SPECTRAL_WEIGHTS
            vec3 x3 = vec3(ray.x_lo, ray.x_anchor, ray.x_hi);
            vec3 n_i = vec3(medium_index(crossing.before, x3.x), medium_index(crossing.before, x3.y), medium_index(crossing.before, x3.z));
            vec3 n_t = vec3(medium_index(crossing.after, x3.x), medium_index(crossing.after, x3.y), medium_index(crossing.after, x3.z));
#if SPECTRAL_GROUPS > 0
            for (int g = 0; g < SPECTRAL_GROUPS; ++g) {
                float dtheta = dot(ray.ddirection[SPATIAL + g].xyz, normal) + dot(ray.direction, dnormal[SPATIAL + g]);
                theta3.x += dtheta * variable_step(uint(g), x3.x, x3.y);
                theta3.z += dtheta * variable_step(uint(g), x3.z, x3.y);
            }
            theta3.xz = clamp(theta3.xz, -1.0, -1e-6);
#endif
#else
            vec3 n_i = vec3(medium_index(crossing.before, ray.x_anchor));
            vec3 n_t = vec3(medium_index(crossing.after, ray.x_anchor));
#endif
            vec3 eta3 = n_i / n_t;
            vec3 cosine2 = transmitted_cosine2(theta3, eta3);
            bool cut = false;
#ifdef BAND_CUTS
            bvec3 passes = greaterThan(cosine2, vec3(0.0));
            cut = any(passes) && !all(passes) && (ray.flags & FLAG_BAND_FINAL) == 0u && ray.x_hi - ray.x_lo > MIN_CUT_BAND;
            float at = 0.0;
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
                        theta_x += (dot(ray.ddirection[SPATIAL + g].xyz, normal) + dot(ray.direction, dnormal[SPATIAL + g])) * variable_step(uint(g), x, ray.x_anchor);
                    float eta_x = medium_index(crossing.before, x) / medium_index(crossing.after, x);
                    bool passes_x = transmitted_cosine2(clamp(theta_x, -1.0, -1e-6), eta_x) > 0.0;
                    a = passes_x == passes_a ? x : a;
                    b = passes_x == passes_a ? b : x;
                }
                at = 0.5 * (a + b);
                // A sliver of a band is not worth a path of its own.
                cut = min(at - ray.x_lo, ray.x_hi - at) > 0.01 * MIN_CUT_BAND;
            }
            if (cut) {
                float power_lo = spectral_row(uint(p.power_row), ray.x_lo), power_at = spectral_row(uint(p.power_row), at), power_hi = spectral_row(uint(p.power_row), ray.x_hi);
                float share = clamp((power_at - power_lo) / max(power_hi - power_lo, 1e-30), 0.0, 1.0);
                // Back to the start of the flight: the surface is met again next time.
                RayRecord whole = rays_in[indices[k]];
                whole.flux_w = ray.flux_w + outcome.absorbed_w;
                outcome.absorbed_w = 0.0;
                whole.flags |= FLAG_BAND_FINAL;
                RayRecord low = whole, high = whole;
                anchor_at(low, whole.x_lo, at);
                anchor_at(high, at, whole.x_hi);
                low.flux_w = whole.flux_w * share;
                high.flux_w = whole.flux_w * (1.0 - share);
                low.branch_key = hash_combine(whole.branch_key, 5u);
                high.branch_key = hash_combine(whole.branch_key, 6u);
                rays_out[2u * k] = low;
                rays_out[2u * k + 1u] = high;
                outcome.what |= 3u | FELL_BAND;
            }
#endif
            if (!cut) {
                vec3 reflectance = fresnel_reflectance(theta3, eta3, cosine2);
                float omega2 = cosine2.y, eta_it = eta3.y;
                float through = 1.0 - reflectance.y;
                vec3 direction_r = reflect_direction(ray.direction, normal, theta);
                bool geometric_r = dot(direction_r, normal_g) <= 0.0;
                vec3 reflect_n = geometric_r ? normal_g : normal;
                float reflect_theta = geometric_r ? theta_g : theta;
                reflected.flux_w = ray.flux_w * reflectance.y;
                reflected.throughput = ray.throughput * reflectance;
                reflected.direction = normalize(reflect_direction(ray.direction, reflect_n, reflect_theta));
#if COLUMNS > 0
                for (int c = 0; c < COLUMNS; ++c)
                    reflected.ddirection[c].xyz = reflect_column(ray.direction, ray.ddirection[c].xyz, reflect_n, geometric_r ? vec3(0.0) : dnormal[c], reflect_theta);
#endif
                outcome.what |= geometric_r ? FELL_NORMAL : 0u;
                if (reflected.flux_w > 0.0 && survives(reflected, outcome.roulette_w, reflectance.y, 1u)) {
                    rays_out[2u * k] = reflected;
                    outcome.what |= 1u;
                }
                if (omega2 > 0.0) {
                    RayRecord refracted = ray;
                    float omega = sqrt(omega2);
                    vec3 direction_t = refract_direction(ray.direction, normal, theta, eta_it, omega);
                    vec3 refract_n = normal;
                    float refract_theta = theta;
                    bool geometric_t = dot(direction_t, normal_g) >= 0.0;
                    if (geometric_t) {
                        float g2 = transmitted_cosine2(theta_g, eta_it);
                        refract_n = normal_g;
                        refract_theta = theta_g;
                        omega = sqrt(max(g2, 1e-12));
                        direction_t = refract_direction(ray.direction, normal_g, theta_g, eta_it, omega);
                        outcome.what |= FELL_NORMAL;
                    }
                    refracted.direction = normalize(direction_t);
                    refracted.flux_w = ray.flux_w * through;
                    refracted.throughput = ray.throughput * (1.0 - reflectance);
                    refracted.last_primitive = hit.primitive;
                    refracted.last_object = hit.object;
                    refracted.flags = (ray.flags & FLAG_FOOTPRINT_DROPPED) | (entering ? FLAG_INSIDE : 0u);
                    refracted.depth = ray.depth + 1u;
                    refracted.inside_mask = crossing.mask_after;
                    refracted.inside_object = crossing.object_after;
#if COLUMNS > 0
                    for (int c = 0; c < COLUMNS; ++c) {
                        float deta_it = 0.0;
#if SPECTRAL_GROUPS > 0
                        if (c >= SPATIAL)
                            deta_it = index_ratio_derivative(crossing, uint(c - SPATIAL), ray.x_anchor, n_i.y, n_t.y);
#endif
                        refracted.ddirection[c].xyz = refract_column(ray.direction, ray.ddirection[c].xyz, refract_n, geometric_t ? vec3(0.0) : dnormal[c], refract_theta, eta_it, omega, deta_it);
                    }
#endif
                    if (survives(refracted, outcome.roulette_w, through, 2u)) {
                        rays_out[2u * k + 1u] = refracted;
                        outcome.what |= 2u;
                    }
                }
            }
        }
#endif
    }
    outcomes[k] = outcome;
}
