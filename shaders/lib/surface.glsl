// How one ray leaves a specular surface it has hit: the normal that it sees, where exactly it stands, reflected and
// refracted directions that stay on their side of the facet. For rays without columns (camera, picks, ray fans).
#ifndef SURFACE_GLSL
#define SURFACE_GLSL

#include "lib/intersect.glsl"
#include "lib/optics.glsl"

// The geometric normal, turned against the ray.
vec3 facing_geometric(Hit hit, vec3 direction)
{
    return dot(direction, hit.normal_g) < 0.0 ? hit.normal_g : -hit.normal_g;
}

// Unit normal a specular surface shades with, turned against the ray.
vec3 facing_normal(Hit hit, vec3 direction)
{
    vec3 normal_g = facing_geometric(hit, direction);
#if defined(SMOOTH_NORMALS) && defined(LOOSE_TRIANGLES)
    if ((hit.primitive & PLANE_BIT) != 0u) return normal_g;
    uint first = triangle_at(hit.primitive).normals;
    if (first == NONE) return normal_g;
    vec3 normal = normalize((1.0 - hit.bary.x - hit.bary.y) * corner_normal(first)
                            + hit.bary.x * corner_normal(first + 1u) + hit.bary.y * corner_normal(first + 2u));
    normal = dot(normal, normal_g) < 0.0 ? -normal : normal;
    // Where the interpolated normal turns away from the ray the geometric one is the judge.
    return dot(direction, normal) < -1e-4 ? normal : normal_g;
#else
    return normal_g;
#endif
}

// Reflected by the shading normal, or by the geometric one where that would lead into the surface.
vec3 reflected_direction(Hit hit, vec3 direction, vec3 normal)
{
    vec3 normal_g = facing_geometric(hit, direction);
    vec3 turned = reflect_direction(direction, normal, dot(direction, normal));
    return normalize(dot(turned, normal_g) > 0.0 ? turned : reflect_direction(direction, normal_g, dot(direction, normal_g)));
}

// Refracted by the shading normal, or by the geometric one where that would lead back out of the surface; reflected where
// the judging normal transmits nothing, which `total` tells.
vec3 refracted_direction(Hit hit, vec3 direction, vec3 normal, float eta_it, out bool total)
{
    float theta = dot(direction, normal);
    float cosine2 = transmitted_cosine2(theta, eta_it);
    total = cosine2 <= 0.0;
    if (total) return reflected_direction(hit, direction, normal);
    vec3 normal_g = facing_geometric(hit, direction);
    vec3 refracted = refract_direction(direction, normal, theta, eta_it, sqrt(cosine2));
    if (dot(refracted, normal_g) >= 0.0) {
        float theta_g = dot(direction, normal_g);
        float cosine2_g = transmitted_cosine2(theta_g, eta_it);
        total = cosine2_g <= 0.0;
        if (total) return reflected_direction(hit, direction, normal_g);
        refracted = refract_direction(direction, normal_g, theta_g, eta_it, sqrt(cosine2_g));
    }
    return normalize(refracted);
}

// Where a ray that starts at `origin` hit, on the surface as exactly as its own coordinates can say.
vec3 surface_point(Hit hit, vec3 origin, vec3 direction)
{
    vec3 position = origin + hit.distance * direction;
    if (hit.primitive == NONE) return position;
#ifdef CONVEX_SOLIDS
    if ((hit.primitive & PLANE_BIT) != 0u) {
        vec4 plane = planes[hit.primitive & ~PLANE_BIT];
        return position - plane.xyz * (dot(position, plane.xyz) - plane.w);
    }
#endif
#ifdef LOOSE_TRIANGLES
    Triangle facet = triangle_at(hit.primitive);
    position = facet.vertex + hit.bary.x * facet.edge1 + hit.bary.y * facet.edge2;
#endif
    return position;
}

#endif
