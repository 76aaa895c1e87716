// How much of the environment's light reaches places on receivers (app/passes/environment_light.py). Two questions,
// which share out all directions between them, so that nothing counts twice: what comes straight, in directions drawn
// by the environment's brightness, where anything hides it, glass too; and what comes by way of glass and mirrors, in
// directions towards those, each followed backwards to the environment. One dispatch asks a few directions, the same of
// all places.
layout(local_size_x = 64) in;

#include "lib/interface.glsl"
#include "lib/random.glsl"
#include "light/place.glsl"
#if FOLLOWS_SPECULAR
#include "light/followed.glsl"
#endif

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { EnvironmentParameters p; };
layout(std430, binding = BIND_PLACES) readonly restrict buffer Places { EnvironmentPlace places[]; };
layout(std140, binding = BIND_ASKED) uniform Asked { EnvironmentAsked asked[MOST_ASKED]; };
layout(std430, binding = BIND_SUMS) restrict buffer Sums { GatheredSum sums[]; };
#if FOLLOWS_SPECULAR
layout(binding = UNIT_ENVIRONMENT) uniform sampler2D environment_levels;

// Mean radiance of one level of the environment about a direction, bilinear.
vec3 environment_at(vec3 direction, uvec4 level) {
    vec3 local = p.sky_x.xyz * direction.x + p.sky_y.xyz * direction.y + p.sky_z.xyz * direction.z;
    float flat_length = length(local.xy);
    float azimuth = flat_length > 0.0 ? atan(local.y, local.x) : 0.0;
    vec2 at = vec2(0.5 - azimuth * 0.15915494309, atan(flat_length, local.z) * 0.31830988618) * vec2(level.yz) - 0.5;
    ivec2 low = ivec2(floor(at)), size = ivec2(level.yz);
    vec2 share = at - vec2(low);
    ivec2 columns = ivec2((low.x + size.x) % size.x, (low.x + 1 + size.x) % size.x);
    ivec2 rows = clamp(ivec2(low.y, low.y + 1), 0, size.y - 1) + int(level.x);
    vec3 above = mix(texelFetch(environment_levels, ivec2(columns.x, rows.x), 0).rgb,
        texelFetch(environment_levels, ivec2(columns.y, rows.x), 0).rgb, share.x);
    vec3 below = mix(texelFetch(environment_levels, ivec2(columns.x, rows.y), 0).rgb,
        texelFetch(environment_levels, ivec2(columns.y, rows.y), 0).rgb, share.x);
    return mix(above, below, share.y);
}
#endif

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= p.count) return;
    EnvironmentPlace place = places[id];
    GatheredSum sum = sums[id];
    RayOrigin origin = RayOrigin(place.primitive, place.object, place.inside, 0u);
    for (uint i = 0u; i < p.straight; ++i) {
        vec3 toward = asked[i].toward;
        vec3 amount = asked[i].weight * max(dot(toward, place.normal), 0.0);
        vec3 position = position_in(place, asked[i].within);
        sum.all += amount;
        bool reaches = false;
        if (amount != vec3(0.0)) reaches = !intersect_any(position, toward, FAR_DISTANCE, origin);
        if (reaches) sum.straight += amount;
    }
#if FOLLOWS_SPECULAR
    for (uint i = p.straight; i < p.straight + p.followed; ++i) {
        vec3 position = position_in(place, asked[i].within);
        float weight, lost = 0.0;
        bool narrow;
        // Neighbours ask in other directions: their mean, which is what is shown, knows many more than each.
        uint own = hash_combine(asked[i].key, id);
        vec2 shift = vec2(unit_float(hash_pcg(id)), unit_float(hash_pcg(id ^ 0x9e3779b9u)));
        vec3 toward =
            toward_specular(p.specular, position, place.normal, fract(asked[i].toward.xy + shift), weight, narrow);
        if (weight > 0.0) {
            FollowedRay ray = follow_specular(position, toward, origin, own, p.x_of_rgb, lost);
            if (ray.events > 0u && ray.met == 0u)
                sum.specular += weight * ray.path.walk.tint
                    * environment_at(ray.path.direction, narrow ? p.level_narrow : p.level_wide);
        }
        sum.lost += lost;
    }
#endif
    sums[id] = sum;
}
