// Light that places on receivers get from other diffuse surfaces (app/passes/bounce_light.py): these shine as a texture
// says. What is met straight is found twice over, in directions by the cosine and at places drawn by their light, and
// weighed by both; what comes by way of glass and mirrors, in directions towards those. One dispatch asks a few of
// each, the same of all places.
layout(local_size_x = 64) in;

#include "lib/bounce.glsl"
#include "lib/interface.glsl"
#include "lib/random.glsl"
#include "lib/receiver_light.glsl"
#include "light/place.glsl"
#include "light/followed.glsl"

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { BounceParameters p; };
layout(std430, binding = BIND_PLACES) readonly restrict buffer Places { EnvironmentPlace places[]; };
layout(std140, binding = BIND_ASKED) uniform Asked { BounceAsked asked[MOST_ASKED]; };
layout(std430, binding = BIND_SUMS) restrict buffer Sums { GatheredSum sums[]; };
// What receivers send back: linear Rec.709 radiance, and with what density per GPU unit² a place there is drawn.
layout(binding = UNIT_RADIANCE) uniform sampler2D receiver_radiance;

// Over the receiver that a ray meets, of the place that it comes from, where that faces it.
float over_receiver = FAR_DISTANCE;

// Under what is so near a receiver it alone sees the covered part.
bool is_covered(sampler2D map, RayOrigin origin, vec3 position, vec3 normal, float reach) {
    return over_receiver < reach;
}

vec4 radiance_from(Hit hit, vec3 position, vec3 direction) {
    Object thing = object_at(hit.object);
    vec4 found = vec4(0.0);
    if (thing.kind == KIND_DIFFUSE) {
        bool back = dot(direction, hit.normal_g) > 0.0;
        RayOrigin origin = RayOrigin(hit.primitive, hit.object, uint(back), 0u);
        found = receiver_light(receiver_radiance, hit_triangle(hit).source, origin, position + hit.distance * direction,
            back ? -hit.normal_g : hit.normal_g);
    }
    return found;
}

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= p.count) return;
    EnvironmentPlace place = places[id];
    GatheredSum sum = sums[id];
    RayOrigin origin = RayOrigin(place.primitive, place.object, place.inside, 0u);
    for (uint i = 0u; i < p.straight; ++i) {
        vec3 position = position_in(place, asked[i].within);
        bool aims = i >= p.by_cosine;
        vec3 way = aims ? asked[i].place - position : cosine_direction(place.normal, asked[i].place.xy);
        float distance2 = dot(way, way);
        vec3 toward = way * inversesqrt(max(distance2, 1e-20));
        float cosine = dot(toward, place.normal);
        bool faces = cosine > 0.0 && (!aims || dot(toward, asked[i].normal) < 0.0);
        Hit hit;
        bool met = false;
        if (faces) met = intersect_closest(position, toward, FAR_DISTANCE, origin, hit);
        if (met) {
            vec3 way_up = dot(toward, hit.normal_g) > 0.0 ? -hit.normal_g : hit.normal_g;
            over_receiver = dot(place.normal, way_up) < -0.5 ? -hit.distance * dot(toward, way_up) : FAR_DISTANCE;
            vec4 radiance = radiance_from(hit, position, toward);
            // The very place that was drawn, and not one of the finer texels that lie over a part of it.
            bool counts = !aims
                || (hit.object == asked[i].object && abs(hit.distance * hit.distance - distance2) < 1e-3 * distance2
                    && abs(radiance.a - asked[i].density) < 1e-3 * asked[i].density);
            if (counts)
                sum.straight += radiance.rgb
                    * gathered(cosine, abs(dot(toward, hit.normal_g)), hit.distance * hit.distance,
                        p.aims != 0u ? radiance.a : 0.0);
        }
    }
    if (FOLLOWS_SPECULAR) {
        for (uint i = p.straight; i < p.straight + p.followed; ++i) {
            vec3 position = position_in(place, asked[i].within);
            float weight, lost = 0.0;
            bool narrow;
            uint own = hash_combine(asked[i].object, id);
            vec2 shift = vec2(unit_float(hash_pcg(id)), unit_float(hash_pcg(id ^ 0x9e3779b9u)));
            vec3 toward =
                toward_specular(p.specular, position, place.normal, fract(asked[i].place.xy + shift), weight, narrow);
            if (weight > 0.0) {
                FollowedRay ray = follow_specular(position, toward, origin, own, p.x_of_rgb, lost);
                over_receiver = FAR_DISTANCE;
                if (ray.events > 0u && ray.met != 0u)
                    sum.specular +=
                        weight * ray.path.walk.tint * radiance_from(ray.hit, ray.path.position, ray.path.direction).rgb;
            }
            sum.lost += lost;
        }
    }
    sums[id] = sum;
}
