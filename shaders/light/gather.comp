// Light that places on receivers get from the environment (app/passes/environment_light.py) or, OF_RECEIVERS, from
// other diffuse surfaces, which shine as a texture says (app/passes/bounce_light.py). What comes straight and what
// comes by way of glass and mirrors is found apart, so that nothing counts twice; the latter in directions towards
// those, each followed backwards. One dispatch queries a few directions, the same of all places.
layout(local_size_x = 64) in;

#include "lib/bounce.glsl"
#include "lib/interface.glsl"
#include "lib/random.glsl"
#include "lib/receiver_light.glsl"
#include "light/place.glsl"
#include "light/followed.glsl"

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { GatherParameters p; };
layout(std430, binding = BIND_PLACES) readonly restrict buffer Places { EnvironmentPlace places[]; };
layout(std140, binding = BIND_ASKED) uniform Asked { GatherDirection directions[MOST_ASKED]; };
layout(std430, binding = BIND_SUMS) restrict buffer Sums { GatheredSum sums[]; };
// Radiance in linear Rec.709: levels of the environment; or what receivers send back, and with what density per GPU
// unit² a place there is drawn.
layout(binding = UNIT_RADIANCE) uniform sampler2D radiances;

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
    vec3 above = mix(texelFetch(radiances, ivec2(columns.x, rows.x), 0).rgb,
        texelFetch(radiances, ivec2(columns.y, rows.x), 0).rgb, share.x);
    vec3 below = mix(texelFetch(radiances, ivec2(columns.x, rows.y), 0).rgb,
        texelFetch(radiances, ivec2(columns.y, rows.y), 0).rgb, share.x);
    return mix(above, below, share.y);
}

// What arrives of the environment by a path: at each of its wavelengths from where that leaves the scene.
vec3 environment_by(Path path, uvec4 level) {
    vec3 found = vec3(0.0), radiance = environment_at(path.direction, level);
    for (int tap = 0; tap < GATHER_TAPS; ++tap) {
        if (((path.walk.taps >> uint(tap)) & 1u) == 0u) continue;
        if (path.restricted != 0u) {
            vec3 position, direction;
            ray_at(path, path.walk.x[tap / 3][tap % 3], position, direction);
            radiance = environment_at(direction, level);
        }
        vec3 arrived = path.walk.tint[tap / 3][tap % 3] * radiance;
        found +=
            arrived.r * p.taps[3 * tap].rgb + arrived.g * p.taps[3 * tap + 1].rgb + arrived.b * p.taps[3 * tap + 2].rgb;
    }
    return found;
}

// The wavelengths that a path represents: one within each tap, all at the same share of it.
Walk begin_walk(uint key, out float x_anchor) {
    Walk walk;
    walk.taps = (1u << uint(GATHER_TAPS)) - 1u;
    if (GATHERED_SPECTRUM) {
        float share = unit_float(hash_combine(key, 0x200u));
        int anchor = int(unit_float(hash_combine(key, 0x201u)) * float(GATHER_TAPS));
        for (int tap = 0; tap < GATHER_TAPS; ++tap) {
            float x = mix(p.taps[3 * tap].w, p.taps[3 * tap + 1].w, share);
            walk.x[tap / 3][tap % 3] = x;
            x_anchor = tap == anchor ? x : x_anchor;
        }
    } else {
        walk.x[0] = p.x_of_rgb.rgb;
        x_anchor = p.x_of_rgb.w;
    }
    for (int t = 0; t < TINTS; ++t) walk.tint[t] = vec3(1.0);
    return walk;
}

// What comes straight from the environment, in directions drawn by its brightness, where nothing hides it, not even
// glass.
void add_environment(GatherDirection asked, EnvironmentPlace place, RayOrigin origin, inout GatheredSum sum) {
    vec3 toward = asked.target;
    vec3 amount = asked.weight * max(dot(toward, place.normal), 0.0);
    vec3 position = position_in(place, asked.within);
    sum.all += amount;
    bool reaches = false;
    if (amount != vec3(0.0)) reaches = !intersect_any(position, toward, FAR_DISTANCE, origin);
    if (reaches) sum.straight += amount;
}

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
        found = receiver_light(radiances, hit_triangle(hit).source, origin, position + hit.distance * direction,
            back ? -hit.normal_g : hit.normal_g);
    }
    return found;
}

// What comes straight from other receivers: found twice over, in directions by the cosine and at places drawn by their
// light (`aims`), and weighed by both.
void add_receivers(GatherDirection asked, bool aims, EnvironmentPlace place, RayOrigin origin, inout GatheredSum sum) {
    vec3 position = position_in(place, asked.within);
    vec3 way = aims ? asked.target - position : cosine_direction(place.normal, asked.target.xy);
    float distance2 = dot(way, way);
    vec3 toward = way * inversesqrt(max(distance2, 1e-20));
    float cosine = dot(toward, place.normal);
    bool faces = cosine > 0.0 && (!aims || dot(toward, asked.normal) < 0.0);
    Hit hit;
    bool met = false;
    if (faces) met = intersect_closest(position, toward, FAR_DISTANCE, origin, hit);
    if (met) {
        vec3 way_up = dot(toward, hit.normal_g) > 0.0 ? -hit.normal_g : hit.normal_g;
        over_receiver = dot(place.normal, way_up) < -0.5 ? -hit.distance * dot(toward, way_up) : FAR_DISTANCE;
        vec4 radiance = radiance_from(hit, position, toward);
        // The very place that was drawn, and not one of the finer texels that lie over a part of it.
        bool counts = !aims
            || (hit.object == asked.key && abs(hit.distance * hit.distance - distance2) < 1e-3 * distance2
                && abs(radiance.a - asked.density) < 1e-3 * asked.density);
        if (counts)
            sum.straight += radiance.rgb
                * gathered(cosine, abs(dot(toward, hit.normal_g)), hit.distance * hit.distance,
                    p.aims != 0u ? radiance.a : 0.0);
    }
}

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= p.count) return;
    EnvironmentPlace place = places[id];
    GatheredSum sum = sums[id];
    RayOrigin origin = RayOrigin(place.primitive, place.object, place.inside, 0u);
    for (uint i = 0u; i < p.straight; ++i) {
        if (OF_RECEIVERS)
            add_receivers(directions[i], i >= p.by_cosine, place, origin, sum);
        else
            add_environment(directions[i], place, origin, sum);
    }
    if (FOLLOWS_SPECULAR) {
        // Neighbours query other directions: their mean, which is what is shown, knows many more than each.
        vec2 shift = vec2(unit_float(hash_pcg(id)), unit_float(hash_pcg(id ^ 0x9e3779b9u)));
        for (uint i = p.straight; i < p.straight + p.followed; ++i) {
            GatherDirection asked = directions[i];
            vec3 position = position_in(place, asked.within);
            float weight, lost = 0.0;
            bool narrow;
            vec3 toward =
                toward_specular(p.specular, position, place.normal, fract(asked.target.xy + shift), weight, narrow);
            if (weight > 0.0) {
                uint key = hash_combine(asked.key, id);
                float x_anchor;
                Walk walk = begin_walk(key, x_anchor);
                FollowedRay ray = follow_specular(position, toward, origin, key, walk, x_anchor, lost);
                vec3 tint = weight * ray.path.walk.tint[0];
                uvec4 level = narrow ? p.level_narrow : p.level_wide;
                if (OF_RECEIVERS) {
                    over_receiver = FAR_DISTANCE;
                    if (ray.events > 0u && ray.met != 0u)
                        sum.specular += tint * radiance_from(ray.hit, ray.path.position, ray.path.direction).rgb;
                } else if (ray.events > 0u && ray.met == 0u) {
                    if (GATHERED_SPECTRUM)
                        sum.specular += weight * environment_by(ray.path, level);
                    else
                        sum.specular += tint * environment_at(ray.path.direction, level);
                }
            }
            sum.lost += lost;
        }
    }
    sums[id] = sum;
}
