// How much of the environment's light reaches places on receivers (app/passes/environment_light.py). Two questions, which share out all
// directions between them, so that nothing counts twice: what comes straight, in directions drawn by the environment's brightness, where
// anything hides it, glass too; and what comes by way of glass and mirrors, in directions towards those, each followed backwards to
// the environment. One dispatch asks a few directions, the same of all places.
layout(local_size_x = 64) in;

#include "lib/medium.glsl"
#include "lib/interface.glsl"
#include "lib/random.glsl"
#ifdef POLARISED
#include "lib/polarisation.glsl"
#endif

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { EnvironmentParameters p; };
layout(std430, binding = BIND_PLACES) readonly restrict buffer Places { EnvironmentPlace places[]; };
layout(std140, binding = BIND_ASKED) uniform Asked { EnvironmentAsked asked[MOST_ASKED]; };
layout(std430, binding = BIND_SUMS) restrict buffer Sums { EnvironmentSum sums[]; };
#ifdef FOLLOWS_SPECULAR
layout(binding = UNIT_ENVIRONMENT) uniform sampler2D environment_levels;

// Mean radiance of one level of the environment about a direction, bilinear.
vec3 environment_at(vec3 direction, uvec4 level)
{
    vec3 local = p.sky_x.xyz * direction.x + p.sky_y.xyz * direction.y + p.sky_z.xyz * direction.z;
    float flat_length = length(local.xy);
    float azimuth = flat_length > 0.0 ? atan(local.y, local.x) : 0.0;
    vec2 at = vec2(0.5 - azimuth * 0.15915494309, atan(flat_length, local.z) * 0.31830988618) * vec2(level.yz) - 0.5;
    ivec2 low = ivec2(floor(at)), size = ivec2(level.yz);
    vec2 share = at - vec2(low);
    ivec2 columns = ivec2((low.x + size.x) % size.x, (low.x + 1 + size.x) % size.x);
    ivec2 rows = clamp(ivec2(low.y, low.y + 1), 0, size.y - 1) + int(level.x);
    vec3 above = mix(texelFetch(environment_levels, ivec2(columns.x, rows.x), 0).rgb, texelFetch(environment_levels, ivec2(columns.y, rows.x), 0).rgb, share.x);
    vec3 below = mix(texelFetch(environment_levels, ivec2(columns.x, rows.y), 0).rgb, texelFetch(environment_levels, ivec2(columns.y, rows.y), 0).rgb, share.x);
    return mix(above, below, share.y);
}

// A spectral table's row for red, green and blue.
vec3 at_rgb(uint row)
{
    return vec3(spectral_row(row, p.x_of_rgb.x), spectral_row(row, p.x_of_rgb.y), spectral_row(row, p.x_of_rgb.z));
}

// What comes along a ray whose first surface is glass or a mirror; nothing where it meets another one first, or none.
vec3 by_specular(vec3 position, vec3 direction, RayOrigin origin, uvec4 level, uint key, inout float lost)
{
    MediumStack medium = MediumStack(0u, NONE);
    vec3 weight = vec3(1.0), found = vec3(0.0);
#ifdef POLARISED
    Polarisation polarisation = unpolarised(direction);
#endif
    bool follows = true;
    for (uint event = 0u; event < uint(MAX_EVENTS) && follows; ++event) {
        Hit hit;
        bool met = intersect_closest(position, direction, FAR_DISTANCE, origin, hit);
        uint kind = met ? object_at(hit.object).kind : NONE;
        follows = kind == KIND_MIRROR || kind == KIND_DIELECTRIC;
        if (!met && event > 0u) found = weight * environment_at(direction, level);
        if (follows) {
            Triangle facet = hit_triangle(hit);
            ShadingFrame frame = shading_frame(hit, facet, direction);
            bool entering = dot(direction, hit.normal_g) < 0.0;
            position = surface_point(hit, facet, position, direction);
#ifdef ABSORPTION
            // A place in a liquid learns so where it leaves it.
            if (event == 0u && kind == KIND_DIELECTRIC && !entering && !is_inside(medium)) medium.object = hit.object;
            uint row = medium_weight_row(medium);
            if (row != NONE) weight *= exp(-hit.distance * at_rgb(uint(WEIGHT_ROW) + row));
#endif
            Deflection turned = reflect_at(frame, direction);
            bool passes = false;
#ifdef POLARISED
            vec3 axis = incidence_axis(direction, frame.normal, polarisation.axis), s[3] = vec3[](axis, axis, axis);
            Polarisation seen = in_plane(polarisation, direction, s);
            FresnelPair pair = mirror_reflection();
            bool changes = true;
#endif
#ifdef HAS_MIRROR
            if (kind == KIND_MIRROR) weight *= at_rgb(uint(WEIGHT_ROW) + object_at(hit.object).weight_row);
#endif
#ifdef HAS_DIELECTRIC
            if (kind == KIND_DIELECTRIC) {
                MediumInterface boundary = cross_boundary(medium, hit.object, entering);
                passes = true;
                if (boundary.changes) {
                    float eta_it = medium_index(boundary.before, p.x_of_rgb.w) / medium_index(boundary.after, p.x_of_rgb.w);
                    Deflection refracted = refract_at(frame, direction, eta_it);
#ifdef POLARISED
                    vec3 cosine2 = vec3(transmitted_cosine2(refracted.theta, eta_it));
                    pair = fresnel_reflection(vec3(refracted.theta), vec3(eta_it), cosine2);
                    float reflectance = polarised_share(seen, pair).x;
#else
                    float reflectance = fresnel_reflectance(refracted.theta, eta_it, refracted.exists ? transmitted_cosine2(refracted.theta, eta_it) : 0.0);
#endif
                    passes = refracted.exists && unit_float(hash_combine(key, event)) >= reflectance;
                    if (passes) turned = refracted;
                } else turned.direction = direction;
#ifdef POLARISED
                changes = boundary.changes;
                if (passes) pair = fresnel_transmission(pair);
#endif
                if (passes) medium = boundary.behind;
            }
#endif
            direction = turned.direction;
#ifdef POLARISED
            if (changes) polarisation = out_of_plane(behind_interface(seen, pair), direction, s);
#endif
            origin = RayOrigin(hit.primitive, hit.object, uint(passes ? entering : !entering), medium.mask);
            lost = float(event + 1u == uint(MAX_EVENTS));
        }
    }
    if (!follows) lost = 0.0;
    return found;
}

// A direction towards the sphere that holds all glass and mirrors, or anywhere above where that is near: its weight is cosine over probability.
vec3 toward_specular(vec3 position, vec3 normal, vec2 place, out float weight, out bool narrow)
{
    vec3 way = p.specular.xyz - position;
    float distance2 = dot(way, way), sine2 = p.specular.w * p.specular.w / max(distance2, 1e-20);
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
#endif

void main()
{
    uint id = gl_GlobalInvocationID.x;
    if (id >= p.count) return;
    EnvironmentPlace place = places[id];
    EnvironmentSum sum = sums[id];
    RayOrigin origin = RayOrigin(place.primitive, place.object, place.inside, 0u);
    for (uint i = 0u; i < p.straight; ++i) {
        vec3 toward = asked[i].toward;
        vec3 amount = asked[i].weight * max(dot(toward, place.normal), 0.0);
        vec3 position = place.position + (asked[i].within.x - 0.5) * place.step_u + (asked[i].within.y - 0.5) * place.step_v;
        sum.all += amount;
        bool reaches = false;
        for (bool wanted = amount != vec3(0.0); wanted; wanted = false) reaches = !intersect_any(position, toward, FAR_DISTANCE, origin);
        if (reaches) sum.straight += amount;
    }
#ifdef FOLLOWS_SPECULAR
    for (uint i = p.straight; i < p.straight + p.followed; ++i) {
        vec3 position = place.position + (asked[i].within.x - 0.5) * place.step_u + (asked[i].within.y - 0.5) * place.step_v;
        float weight, lost = 0.0;
        bool narrow;
        // Neighbours ask in other directions: their mean, which is what is shown, knows many more than each.
        uint own = hash_combine(asked[i].key, id);
        vec2 shift = vec2(unit_float(hash_pcg(id)), unit_float(hash_pcg(id ^ 0x9e3779b9u)));
        vec3 toward = toward_specular(position, place.normal, fract(asked[i].toward.xy + shift), weight, narrow);
        uvec4 level = narrow ? p.level_narrow : p.level_wide;
        for (bool wanted = weight > 0.0; wanted; wanted = false)
            sum.specular += weight * by_specular(position, toward, origin, level, own, lost);
        sum.lost += lost;
    }
#endif
    sums[id] = sum;
}
