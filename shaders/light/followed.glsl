// A ray from a diffuse surface that meets glass or a mirror first, followed backwards to where its light comes from:
// which lobe it takes is chance by Fresnel's reflectance, at one index; tints at three wavelengths.

#include "lib/random.glsl"

#define SPATIAL 0
#define PATH_COLUMNS 0
struct Walk {
    vec3 tint;  // share of the light that arrives: red, green, blue
};
#include "path/event.glsl"

struct FollowedRay {
    Path path;
    Hit hit;
    uint events;  // of glass and mirrors; 0: it met none, or was given up
    uint met;  // 1: `hit` is where it ends; 0: it leaves the scene
};

// A spectral table's row for red, green and blue.
vec3 at_rgb(uint row, vec4 x_of_rgb) {
    return vec3(spectral_row(row, x_of_rgb.x), spectral_row(row, x_of_rgb.y), spectral_row(row, x_of_rgb.z));
}

// `x_of_rgb`: spectral coordinates of the tints, and of the index. `lost`: 1 where it was given up after MAX_EVENTS.
FollowedRay follow_specular(
    vec3 position, vec3 direction, RayOrigin origin, uint key, vec4 x_of_rgb, inout float lost) {
    FollowedRay ray;
    ray.events = ray.met = 0u;
    Path path = path_at(position, direction, origin, MediumStack(0u, NONE), x_of_rgb.w);
    path.walk.tint = vec3(1.0);
    bool follows = true;
    for (uint number = 0u; number < uint(MAX_EVENTS) && follows; ++number) {
        Hit hit;
        bool met = intersect_closest(path.position, path.direction, FAR_DISTANCE, path.origin, hit);
        Object thing = object_at(met ? hit.object : 0u);
        uint kind = met ? thing.kind : NONE;
        follows = kind == KIND_MIRROR || IS_GLASS(kind);
        bool entering = dot(path.direction, hit.normal_g) < 0.0;
        if (ABSORPTION) {
            // A place in a liquid learns so where it leaves it.
            if (number == 0u && kind == KIND_DIELECTRIC && !entering && !is_inside(path.medium))
                path.medium.object = hit.object;
            uint row = met ? medium_weight_row(path.medium) : NONE;
            if (row != NONE) path.walk.tint *= exp(-hit.distance * at_rgb(uint(WEIGHT_ROW) + row, x_of_rgb));
        }
        if (!follows) {
            ray.met = uint(met);
            ray.hit = hit;
        } else {
            ray.events = number + 1u;
            Triangle facet = hit_triangle(hit);
            path.position = surface_point(hit, facet, path.position, path.direction);
            Event event = interact(path, hit, facet, thing, MicrofacetDraw(0u, number, hash_combine(key, 0x100u)));
            bool passes = false, changes = true, geometric;
            vec3 unhidden = vec3(1.0);
            if (HAS_MIRROR && kind == KIND_MIRROR)
                path.walk.tint *= at_rgb(uint(WEIGHT_ROW) + thing.weight_row, x_of_rgb);
            if (HAS_DIELECTRIC && IS_GLASS(kind)) {
                changes = event.boundary.changes;
                passes =
                    !changes || (event.cosine2.y > 0.0 && unit_float(hash_combine(key, number)) >= event.reflectance.y);
                if (!changes)
                    path.medium = event.boundary.behind;
                else if (passes) {
                    unhidden = refract_path(path, event);
                    if (SURFACE_FILTERS && thing.texture != NONE)
                        path.walk.tint *= at_rgb(uint(WEIGHT_ROW) + thing.texture, x_of_rgb);
                }
            }
            if (!passes) unhidden = reflect_path(path, event, geometric);
            path.walk.tint *= unhidden.x;
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
