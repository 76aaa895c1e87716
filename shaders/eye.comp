// The eye half: one camera sample a pixel and dispatch, added to the sums. A ray runs through glass and over
// mirrors to the first diffuse surface, which shows direct light (shadow rays stop at anything, glass too)
// plus the caustic map (all light that came by way of glass or mirrors): nothing counts twice.
// Glass is drawn plausibly: one ray refracted at every surface, weighted by Fresnel, totally reflected
// where it must be, and one reflection at the first surface it meets; refractive indices are those of the d line.
layout(local_size_x = 8, local_size_y = 8) in;

#include "lib/intersect.glsl"
#include "lib/camera.glsl"
#include "lib/lights.glsl"
#include "lib/lookup.glsl"
#include "lib/random.glsl"
#include "lib/optics.glsl"
#include "lib/surface.glsl"
#ifdef HAS_DIELECTRIC
// All that medium.glsl needs to know of a ray.
struct RayRecord {
    uint inside_mask;
    uint inside_object;
};
#include "lib/medium.glsl"
#endif

layout(std430, binding = BIND_PARAMETERS) readonly restrict buffer Parameters { EyeParameters p; };
layout(std430, binding = BIND_LIGHTS) readonly restrict buffer Lights { EyeLight lights[]; };
// Per light and reflectance class: the light's own quantity in every channel.
layout(std430, binding = BIND_LIGHT_CHANNELS) readonly restrict buffer LightChannels { vec4 light_channels[]; };
// Per object: reflectance, or absorption coefficient (1/GPU unit); then the background.
layout(std430, binding = BIND_MATERIAL_CHANNELS) readonly restrict buffer MaterialChannels { vec4 material_channels[]; };
layout(rgba32f, binding = 0) uniform image2D picture[TARGETS];

const float INVERSE_PI = 0.31830988618;

struct EyePath {
    vec3 position;
    vec3 direction;
    RayOrigin origin;
    float travelled;          // GPU units from the camera
    vec4 weight[TARGETS];
#ifdef HAS_DIELECTRIC
    RayRecord medium;
#endif
};

// A map's channels are XYZ (lm) where the picture's are linear Rec.709, else the same bins.
vec4 map_to_channels(vec4 texel)
{
#ifdef RGB_CHANNELS
    return vec4(dot(p.red_of_xyz.xyz, texel.xyz), dot(p.green_of_xyz.xyz, texel.xyz), dot(p.blue_of_xyz.xyz, texel.xyz), 0.0);
#else
    return texel;
#endif
}

vec4 light_of(uint light, uint reflectance_class, int target)
{
    return light_channels[(light * uint(CLASSES) + reflectance_class) * uint(TARGETS) + uint(target)];
}

// Two numbers for a light's extent: a Kronecker sequence over the samples, shifted by pixel and light.
vec2 light_point(uint light, uint pixel_key)
{
    uint key = hash_combine(pixel_key, light);
    return vec2(kronecker(p.sample_index, PLASTIC_1, key), kronecker(p.sample_index, PLASTIC_2, hash_pcg(key)));
}

// Irradiance of every channel from all lights, on the side of a surface that `normal` faces.
void add_direct(vec3 position, vec3 normal, RayOrigin origin, uint reflectance_class, uint pixel_key, inout vec4 irradiance[TARGETS])
{
    for (uint i = 0u; i < uint(LIGHT_COUNT); ++i) {
        LightSample s = sample_light(lights[i], position, light_point(i, pixel_key));
        float gain = s.gain * max(dot(s.toward, normal), 0.0);
        if (gain > 0.0) {
            // Up to the light, less a hair so that a surface the light lies on does not hide it.
            gain = intersect_any(position, s.toward, s.distance * 0.99999, origin) ? 0.0 : gain;
            for (int t = 0; t < TARGETS; ++t)
                irradiance[t] += gain * light_of(i, reflectance_class, t);
        }
    }
}

// Radiance a diffuse surface sends back along the path.
void add_diffuse(EyePath path, Hit hit, vec3 position, uint pixel_key, inout vec4 radiance[TARGETS])
{
    uint receiver = object_at(hit.object).receiver;
    uint source = triangle_at(hit.primitive).source;
    uint reflectance_class = receivers[receiver].reflectance_class;
    float facing = dot(path.direction, hit.normal_g);
    vec4 irradiance[TARGETS];
    for (int t = 0; t < TARGETS; ++t) irradiance[t] = vec4(0.0);

    uint placement;
    vec2 texel;
    if (find_texel(receiver, source, position, placement, texel)) {
        float pixel = p.pixel_size + p.pixel_angle * (path.travelled + hit.distance);
        // Texels larger than pixels are interpolated, smaller ones weighed by their share of the sample.
        bool magnified = texel_size(placement) > pixel * inversesqrt(max(abs(facing), 1e-3));
        vec2 box = magnified ? vec2(1.0) : texel_box(placement, path.direction, hit.normal_g, p.sample_side * pixel);
        for (int t = 0; t < TARGETS; ++t)
            irradiance[t] = p.map_scale * map_to_channels(caustic_irradiance(t, placement, texel, box));
    }
#ifdef LAYER_BEAUTY
    vec3 normal = facing < 0.0 ? hit.normal_g : -hit.normal_g;
    add_direct(position, normal, RayOrigin(hit.primitive, hit.object, facing > 0.0, 0u), reflectance_class, pixel_key, irradiance);
#endif
    for (int t = 0; t < TARGETS; ++t) {
        // Other classes than 0 are folded into the map and into `light_of` already.
        vec4 reflectance = reflectance_class == 0u ? material_channels[hit.object * uint(TARGETS) + uint(t)] : vec4(1.0);
        radiance[t] += path.weight[t] * reflectance * INVERSE_PI * irradiance[t];
    }
}

#ifdef LAYER_BEAUTY
// The background, where nothing was met, and the lights that can be seen.
void add_emission(EyePath path, float far, bool met, inout vec4 radiance[TARGETS])
{
    for (int t = 0; t < TARGETS; ++t)
        radiance[t] += met ? vec4(0.0) : path.weight[t] * material_channels[uint(OBJECT_COUNT * TARGETS + t)];
#ifdef VISIBLE_LIGHTS
    for (uint i = 0u; i < uint(LIGHT_COUNT); ++i) {
        float seen = lights[i].measure > 0.0 ? light_seen(lights[i], path.position, path.direction, far) : 0.0;
        if (seen > 0.0)
            for (int t = 0; t < TARGETS; ++t)
                radiance[t] += path.weight[t] * seen * light_of(i, 0u, t);
    }
#endif
}

#endif

#if defined(LAYER_BEAUTY) && defined(HAS_DIELECTRIC)
// One glass surface: the path goes on refracted (or totally reflected); what is reflected besides is left in
// `mirrored`, whose weight says whether it is worth following.
void cross_glass(inout EyePath path, Hit hit, vec3 position, out EyePath mirrored)
{
    bool entering = dot(path.direction, hit.normal_g) < 0.0;
#ifdef ABSORPTION
    uint filling = ray_medium(path.medium);
    if (filling != NONE)
        for (int t = 0; t < TARGETS; ++t)
            path.weight[t] *= exp(-material_channels[filling * uint(TARGETS) + uint(t)] * hit.distance);
#endif
    Crossing crossing = cross_boundary(path.medium, hit.object, entering);
    path.position = position;
    path.travelled += hit.distance;
    mirrored = path;
    mirrored.origin = RayOrigin(hit.primitive, hit.object, !entering, path.medium.inside_mask);
    path.origin = RayOrigin(hit.primitive, hit.object, entering, crossing.mask_after);
    RayRecord beyond = RayRecord(crossing.mask_after, crossing.object_after);
    if (!crossing.changes) {
        path.medium = beyond;
        for (int t = 0; t < TARGETS; ++t) mirrored.weight[t] = vec4(0.0);
        return;
    }
    vec3 normal = facing_normal(hit, path.direction);
    float theta = dot(path.direction, normal);
    float eta_it = medium_index(crossing.before, p.x_eye) / medium_index(crossing.after, p.x_eye);
    float reflectance = fresnel_reflectance(theta, eta_it, transmitted_cosine2(theta, eta_it));
    bool total;
    vec3 onward = refracted_direction(hit, path.direction, normal, eta_it, total);
    mirrored.direction = total ? onward : reflected_direction(hit, path.direction, normal);
    if (total) {
        path.direction = onward;
        path.origin = mirrored.origin;
        for (int t = 0; t < TARGETS; ++t) mirrored.weight[t] = vec4(0.0);
        return;
    }
    for (int t = 0; t < TARGETS; ++t) mirrored.weight[t] *= reflectance;
    path.direction = onward;
    path.medium = beyond;
    for (int t = 0; t < TARGETS; ++t) path.weight[t] *= 1.0 - reflectance;
}
#endif

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy + uvec2(0u, p.first_row);
    if (pixel.x >= p.size.x || pixel.y >= p.size.y) return;
    uint pixel_key = hash_combine(hash_combine(p.seed, pixel.x), pixel.y);
    CameraRay ray = camera_ray(p.position, p.forward, p.half_right, p.half_up, p.orthographic != 0u, picture_point(pixel, p.within_pixel, p.size));

    EyePath path;
    path.position = ray.position;
    path.direction = ray.direction;
    path.origin = RayOrigin(NONE, NONE, false, 0u);
    path.travelled = 0.0;
    vec4 radiance[TARGETS];
    for (int t = 0; t < TARGETS; ++t) {
        path.weight[t] = vec4(1.0);
        radiance[t] = vec4(0.0);
    }
#ifdef HAS_DIELECTRIC
    path.medium = RayRecord(p.inside_mask, p.inside_object);
    path.origin.inside_mask = p.inside_mask;
    EyePath waiting;
    bool waits = false, branched = false;
#endif
    for (int event = 0; event < MAX_EVENTS; ++event) {
        Hit hit;
        bool met = intersect_closest(path.position, path.direction, FAR_DISTANCE, path.origin, hit);
        uint kind = met ? object_at(hit.object).kind : NONE;
        bool goes_on = false;
#ifdef LAYER_BEAUTY
        add_emission(path, hit.distance, met, radiance);
        vec3 position = surface_point(hit, path.position, path.direction);
#else
        vec3 position = path.position + hit.distance * path.direction;
#endif
        if (kind == KIND_DIFFUSE) add_diffuse(path, hit, position, pixel_key, radiance);
#if defined(LAYER_BEAUTY) && defined(HAS_MIRROR)
        if (kind == KIND_MIRROR) {
            vec3 normal = facing_normal(hit, path.direction);
            path.direction = reflected_direction(hit, path.direction, normal);
            path.origin = RayOrigin(hit.primitive, hit.object, dot(path.direction, hit.normal_g) < 0.0, path.origin.inside_mask);
            path.position = position;
            path.travelled += hit.distance;
            for (int t = 0; t < TARGETS; ++t) path.weight[t] *= material_channels[hit.object * uint(TARGETS) + uint(t)];
            goes_on = true;
        }
#endif
#if defined(LAYER_BEAUTY) && defined(HAS_DIELECTRIC)
        if (kind == KIND_DIELECTRIC) {
            EyePath mirrored;
            cross_glass(path, hit, position, mirrored);
            goes_on = true;
            if (!branched && mirrored.weight[0].x > 0.0) {
                waiting = mirrored;
                waits = true;
                branched = true;
            }
        }
        if (waits && (!goes_on || event == MAX_EVENTS - 1 - REFLECTION_EVENTS)) {
            // The refracted path has ended (or used its share of events): follow the reflection.
            path = waiting;
            waits = false;
            goes_on = true;
        }
#endif
        if (!goes_on) break;
    }
    for (int t = 0; t < TARGETS; ++t) {
        vec4 sum = imageLoad(picture[t], ivec2(pixel));
        imageStore(picture[t], ivec2(pixel), sum + radiance[t]);
    }
}
