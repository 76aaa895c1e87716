// Direct light, and places in the caustic maps, of every few pixels of a picture in motion: both vary slowly but at outlines and at the edges of
// shadows, and are the expensive part of what is seen directly. moving_direct.comp looks up the rest.
layout(local_size_x = 8, local_size_y = 8) in;

#include "camera/moving.glsl"

// Place in the atlas (of a map along a plane's own axes) over depth, one over depth (both are linear over the picture), and which map of which object (`LATTICE_…`).
layout(rgba32f, binding = IMAGE_PLACES) uniform writeonly restrict image2D places;
// Radiance by direct light, and a key that two points share where it varies slowly between them; 0: with none.
layout(rgba32f, binding = IMAGE_LIGHT) uniform writeonly restrict image2D light;

void main()
{
    uvec2 point = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(point, m.lattice))) return;
    uvec2 pixel = min(point * m.lattice_step, p.size - 1u), first = seen_first(pixel);
    CameraPath path = path_from(pixel, PIXEL_MIDDLE, 1.0);
    Hit hit = hit_on(first, path);
    bool met = first.y != NONE;
    uint key = 0u, placement = NONE;
    vec3 texel = vec3(0.0, 0.0, 1.0);
    float depth = 1.0;
    radiance[0] = vec4(0.0);
    lights_seen = look_index = 0u;
#if defined(LAYER_BEAUTY) && defined(VISIBLE_LIGHTS)
    add_lights(path, met ? hit.distance : FAR_DISTANCE);
#endif
    bool lamp = any(greaterThan(radiance[0].rgb, vec3(0.0)));
    radiance[0] = vec4(0.0);
#ifdef HAS_RECEIVERS
    WHEN(met && !lamp && kind_of(first) == KIND_DIFFUSE) {
        Triangle facet = hit_triangle(hit);
        Object thing = object_at(hit.object);
        SurfaceInteraction seen = seen_on(path, hit, facet, surface_point(hit, facet, path.position, path.direction), path.direction);
        WavelengthInterval interval = wavelength_interval(path, path.band.x, path.band.z);
        add_direct(path, seen, interval, 0u, no_steady_lights());
#ifdef RECEIVER_LIGHT
        add_receiver_light(path, seen, interval);
#endif
        bool covered = find_texel(thing.receiver, facet.source, seen.position, placement, texel);
        if (!covered) placement = NONE;
        if (p.orthographic == 0u) depth = dot(seen.position - p.position, p.forward);
        ivec3 facing = ivec3(round(32.0 * hit.normal_g));
        key = hash_combine(hash_combine(lights_seen, uint(facing.x * 4096 + facing.y * 64 + facing.z)), hit.object) | 1u;
        bool textured = false;
#ifdef HAS_TEXTURES
        textured = thing.texture != NONE;
#endif
        if (textured || hit.object >= LATTICE_OBJECTS || (placement != NONE && placement >= LATTICE_MAPS)) key = 0u;
    }
#endif
    uint map = min(placement, LATTICE_MAPS) * LATTICE_OBJECTS + min(hit.object, LATTICE_OBJECTS - 1u);
    imageStore(places, ivec2(point), vec4(texel.xy / depth, 1.0 / depth, uintBitsToFloat(map)));
    imageStore(light, ivec2(point), vec4(radiance[0].rgb, uintBitsToFloat(key)));
}
