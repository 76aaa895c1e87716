// Direct light, and places in the caustic maps, of every few pixels of a picture in motion: both vary slowly but at
// outlines and at the edges of shadows, and are the expensive part of what is seen directly. First the points of a
// lattice, then the middles of those cells between them that moving_cells.comp lists.
layout(local_size_x = 32, local_size_y = 8) in;

#include "camera/moving.glsl"

// Place in the atlas (of a map along a plane's own axes) over depth, one over depth (both are linear over the picture),
// and which map of which object (`LATTICE_…`).
layout(rgba32f, binding = IMAGE_PLACES) uniform writeonly restrict image2D places;
// Radiance by direct light.
layout(rgba32f, binding = IMAGE_LIGHT) uniform writeonly restrict image2D light;
// What two points share where both vary slowly between them; 0: with none.
layout(r32ui, binding = IMAGE_MARKS) uniform writeonly restrict uimage2D marks;
// Which map of which object all of a cell shows; NONE where its pixels look themselves.
layout(r32ui, binding = IMAGE_CELLS) uniform restrict uimage2D cells;
#include "camera/moving_lists.glsl"

// What one pixel sees directly.
struct Look {
    vec4 place;
    vec4 light;
    uint mark;
};

Look look_at(uvec2 pixel) {
    uvec2 first = seen_first(pixel);
    Path path = path_from(pixel, PIXEL_MIDDLE, 1.0);
    Hit hit = hit_on(first, path);
    bool met = first.y != NONE;
    uint key = 0u, placement = NONE;
    vec3 texel = vec3(0.0, 0.0, 1.0);
    float depth = 1.0;
    radiance[0] = vec4(0.0);
    lights_seen = look_index = 0u;
    if (LAYER_BEAUTY && VISIBLE_LIGHTS) add_lights(path, met ? hit.distance : FAR_DISTANCE);
    bool lamp = any(greaterThan(radiance[0].rgb, vec3(0.0)));
    radiance[0] = vec4(0.0);
    if (HAS_RECEIVERS && met && !lamp && kind_of(first) == KIND_DIFFUSE) {
        Triangle facet = hit_triangle(hit);
        Object thing = object_at(hit.object);
        SurfaceInteraction seen =
            seen_on(path, hit, facet, surface_point(hit, facet, path.position, path.direction), path.direction);
        WavelengthInterval interval = wavelength_interval(path, path.band.x, path.band.z);
        add_direct(path, seen, interval, 0u, no_steady_lights());
        if (RECEIVER_LIGHT) add_receiver_light(path, seen, interval);
        uint receiver = side_met(thing, seen.direction, seen.normal_g);
        bool covered = find_texel(receiver, facet.source, seen.position, placement, texel);
        if (!covered) placement = NONE;
        if (p.orthographic == 0u) depth = dot(seen.position - p.position, p.forward);
        ivec3 facing = ivec3(round(32.0 * hit.normal_g));
        key =
            hash_combine(hash_combine(lights_seen, uint(facing.x * 4096 + facing.y * 64 + facing.z)), hit.object) | 1u;
        bool textured = false;
        if (HAS_TEXTURES) textured = thing.texture != NONE;
        if (textured || hit.object >= LATTICE_OBJECTS || (placement != NONE && placement >= LATTICE_MAPS)) key = 0u;
    }
    uint map = min(placement, LATTICE_MAPS) * LATTICE_OBJECTS + min(hit.object, LATTICE_OBJECTS - 1u);
    return Look(vec4(texel.xy / depth, 1.0 / depth, uintBitsToFloat(map)), vec4(radiance[0].rgb, 0.0),
        key == 0u ? 0u : hash_combine(key, map) | 1u);
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    bool is_cell = m.lists_cells != 0u;
    if (is_cell) {
        uint number = place_on_list();
        if (number >= uneven_count) return;
        at = ivec2(pixels[number] & 0xffffu, pixels[number] >> 16);
    } else if (any(greaterThanEqual(at, ivec2(m.lattice))))
        return;
    Look look = look_at(min(uvec2(at) * m.lattice_step + (is_cell ? m.lattice_step / 2u : 0u), p.size - 1u));
    if (is_cell) {
        // Where its corners have this mark, `cells` holds it.
        imageStore(cells, at, uvec4(look.mark == imageLoad(cells, at).x ? floatBitsToUint(look.place.w) : NONE));
    } else {
        imageStore(places, at, look.place);
        imageStore(light, at, look.light);
        imageStore(marks, at, uvec4(look.mark));
    }
}
