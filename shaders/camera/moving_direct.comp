// A picture in motion, what is seen directly: every pixel looks the caustic maps up. Direct light lies between the points of a lattice round it
// where these agree; other pixels, at outlines and at the edges of shadows, are listed for moving_uneven.comp: a program that holds all that these
// need would take twice as long on a software renderer, even where none is.
layout(local_size_x = 8, local_size_y = 8) in;

#include "camera/moving.glsl"

layout(rgba32f, binding = IMAGE_PICTURE) uniform writeonly restrict image2D picture;
layout(rgba32f, binding = IMAGE_PLACES) uniform readonly restrict image2D places;
layout(rgba32f, binding = IMAGE_LIGHT) uniform readonly restrict image2D light;
layout(r32ui, binding = IMAGE_CELLS) uniform readonly restrict uimage2D cells;
#include "camera/moving_lists.glsl"

void main()
{
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(pixel, p.size))) return;
    uvec2 first = seen_first(pixel);
    uint kind = kind_of(first);
    radiance[0] = vec4(0.0);
    uvec2 low = min(pixel / m.lattice_step, max(m.lattice, 2u) - 2u), high = min(low + 1u, m.lattice - 1u);
    vec2 from = vec2(low * m.lattice_step), to = vec2(min(high * m.lattice_step, p.size - 1u));
    vec2 share = clamp((vec2(pixel) - from) / max(to - from, vec2(1.0)), 0.0, 1.0);
    uint map = imageLoad(cells, ivec2(low)).x;
    bool even = kind == KIND_DIFFUSE && map != NONE && first.y == map % LATTICE_OBJECTS;
#ifdef HAS_RECEIVERS
    WHEN(even) {
        vec4 light_a = imageLoad(light, ivec2(low)), light_b = imageLoad(light, ivec2(high.x, low.y));
        vec4 light_c = imageLoad(light, ivec2(low.x, high.y)), light_d = imageLoad(light, ivec2(high));
        radiance[0] = mix(mix(light_a, light_b, share.x), mix(light_c, light_d, share.x), share.y);
        uint placement = map / LATTICE_OBJECTS;
        WHEN(placement != LATTICE_MAPS) {
            vec4 place_a = imageLoad(places, ivec2(low)), place_b = imageLoad(places, ivec2(high.x, low.y));
            vec4 place_c = imageLoad(places, ivec2(low.x, high.y)), place_d = imageLoad(places, ivec2(high));
            vec3 at = mix(mix(place_a.xyz, place_b.xyz, share.x), mix(place_c.xyz, place_d.xyz, share.x), share.y);
            // Sides of the pixel in texels, from the lattice's own.
            vec2 right = place_b.xy / place_b.z - place_a.xy / place_a.z, down = place_c.xy / place_c.z - place_a.xy / place_a.z;
            vec2 side = vec2(1.0) / max(to - from, vec2(1.0));
            vec2 box = sqrt(right * right * (side.x * side.x) + down * down * (side.y * side.y));
            box = box.x * box.y < 1.0 ? vec2(1.0) : min(box, vec2(MOST_TEXELS));
            vec4 values[MAP_TARGETS];
            caustic_values(placement, vec3(at.xy / at.z, 1.0), box, values, 0, 0);
            bool plain = receivers[object_at(first.y).receiver].reflectance_class == 0u;
            radiance[0] += p.map_scale * INVERSE_PI * vec4(plain ? object_colours[first.y].rgb : vec3(1.0), 1.0) * map_to_channels(values[0]);
        }
    }
#endif
    bool specular = is_specular(kind);
    uint number = pixel.y * p.size.x + pixel.x;
    WHEN(!even && !specular) pixels[atomicAdd(uneven_count, 1u)] = number;
    WHEN(specular) pixels[p.size.x * p.size.y - 1u - atomicAdd(specular_count, 1u)] = number;
    imageStore(picture, ivec2(pixel), vec4(radiance[0].rgb, 1.0));
}
