// A ray from a diffuse surface that meets glass or a mirror first, followed backwards to where its light comes from: with Fresnel's reflectance
// by chance, at one index, tinted at three wavelengths.
#ifndef LIGHT_FOLLOWED_GLSL
#define LIGHT_FOLLOWED_GLSL

#include "lib/medium.glsl"
#include "lib/interface.glsl"
#include "lib/random.glsl"
#ifdef POLARISED
#include "lib/polarisation.glsl"
#endif
#ifdef ROUGH_SURFACES
#include "lib/rough_surface.glsl"
#include "lib/rough_energy.glsl"
#endif

struct FollowedRay {
    vec3 position;      // of the last surface that threw it on
    uint events;        // of glass and mirrors; 0: it met none, or was given up
    vec3 direction;
    uint met;           // 1: `hit` is where it ends; 0: it leaves the scene
    vec3 weight;        // share of the light that arrives: red, green, blue
    Hit hit;
};

// A spectral table's row for red, green and blue.
vec3 at_rgb(uint row, vec4 x_of_rgb)
{
    return vec3(spectral_row(row, x_of_rgb.x), spectral_row(row, x_of_rgb.y), spectral_row(row, x_of_rgb.z));
}

// `x_of_rgb`: spectral coordinates of the tints, and of the index. `lost`: 1 where it was given up after MAX_EVENTS.
FollowedRay follow_specular(vec3 position, vec3 direction, RayOrigin origin, uint key, vec4 x_of_rgb, inout float lost)
{
    FollowedRay ray;
    ray.events = ray.met = 0u;
    ray.weight = vec3(1.0);
    MediumStack medium = MediumStack(0u, NONE);
#ifdef POLARISED
    Polarisation polarisation = unpolarised(direction);
#endif
    bool follows = true;
    for (uint event = 0u; event < uint(MAX_EVENTS) && follows; ++event) {
        Hit hit;
        bool met = intersect_closest(position, direction, FAR_DISTANCE, origin, hit);
        uint kind = met ? object_at(hit.object).kind : NONE;
        follows = kind == KIND_MIRROR || IS_GLASS(kind);
        bool entering = dot(direction, hit.normal_g) < 0.0;
#ifdef ABSORPTION
        // A place in a liquid learns so where it leaves it.
        if (event == 0u && kind == KIND_DIELECTRIC && !entering && !is_inside(medium)) medium.object = hit.object;
        uint row = met ? medium_weight_row(medium) : NONE;
        if (row != NONE) ray.weight *= exp(-hit.distance * at_rgb(uint(WEIGHT_ROW) + row, x_of_rgb));
#endif
        if (!follows) {
            ray.met = uint(met);
            ray.hit = hit;
        }
        if (follows) {
            Triangle facet = hit_triangle(hit);
            position = surface_point(hit, facet, position, direction);
            ShadingFrame frame = shading_frame(hit, facet, position, direction);
            ray.events = event + 1u;
#ifdef ROUGH_SURFACES
            // One microfacet, which the path loses by as a camera's does.
            vec3 surface = frame.normal;
            vec4 told = object_at(hit.object).colour;
            float width = kind == KIND_DIELECTRIC ? told.x : 0.0, cosine = -dot(direction, surface);
            uint own = hash_combine(key, event + 0x100u);
            if (width > 0.0) frame.normal = visible_microfacet(-direction, surface, width, vec2(unit_float(own), unit_float(hash_pcg(own))));
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
            if (kind == KIND_MIRROR) ray.weight *= at_rgb(uint(WEIGHT_ROW) + object_at(hit.object).weight_row, x_of_rgb);
#endif
#ifdef HAS_DIELECTRIC
            if (IS_GLASS(kind)) {
                MediumInterface boundary = cross_boundary(medium, hit.object, entering);
                passes = true;
                if (boundary.changes) {
                    float eta_it = medium_index(boundary.before, x_of_rgb.w) / medium_index(boundary.after, x_of_rgb.w);
                    Deflection refracted = refract_at(frame, direction, IS_THIN(boundary) ? 1.0 : eta_it);
#ifdef ROUGH_SURFACES
                    // A microfacet's share is its own, also where what it lets through does not leave the surface.
                    if (width > 0.0 && refracted.geometric) {
                        refracted.theta = dot(direction, frame.normal);
                        refracted.exists = true;
                    }
#endif
#ifdef POLARISED
                    vec3 cosine2 = vec3(transmitted_cosine2(refracted.theta, eta_it));
                    pair = fresnel_reflection(vec3(refracted.theta), vec3(eta_it), cosine2);
                    pair = OF_SHEET(boundary, pair);
                    float reflectance = polarised_share(seen, pair).x;
#else
                    float reflectance = fresnel_reflectance(refracted.theta, eta_it, refracted.exists ? transmitted_cosine2(refracted.theta, eta_it) : 0.0);
                    reflectance = OF_SHEET(boundary, vec3(reflectance)).x;
#endif
                    passes = refracted.exists && unit_float(hash_combine(key, event)) >= reflectance;
                    if (passes) turned = refracted;
#ifdef SURFACE_FILTERS
                    uint filter_row = object_at(hit.object).texture;
                    if (passes && filter_row != NONE) ray.weight *= at_rgb(uint(WEIGHT_ROW) + filter_row, x_of_rgb);
#endif
#ifdef ROUGH_SURFACES
                    float leaving = dot(turned.direction, surface) * (passes ? -1.0 : 1.0);
                    if (width > 0.0) ray.weight *= turned.geometric ? 0.0 : regained(told.y, cosine, vec3(eta_it)).x * smith_share(vec3(leaving), width).x;
#endif
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
    if (follows) ray.events = 0u;
    else lost = 0.0;
    ray.position = position;
    ray.direction = direction;
    return ray;
}

// A direction towards the sphere that holds all glass and mirrors, or anywhere above where that is near: its weight is cosine over probability.
vec3 toward_specular(vec4 sphere, vec3 position, vec3 normal, vec2 place, out float weight, out bool narrow)
{
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

#endif
