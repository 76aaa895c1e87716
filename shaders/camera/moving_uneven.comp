// A picture in motion: listed pixels that look at all they see directly themselves.
layout(local_size_x = 64) in;

#include "camera/moving.glsl"

layout(rgba32f, binding = IMAGE_PICTURE) uniform writeonly restrict image2D picture;
#include "camera/moving_lists.glsl"

void main() {
    uint at = place_on_list();
    if (at >= uneven_count) return;
    uvec2 pixel = pixel_of(pixels[at]), first = seen_first(pixel);
    bool met = first.y != NONE;
    radiance[0] = vec4(0.0);
    lights_seen = look_index = 0u;
    Path path = path_from(pixel, PIXEL_MIDDLE, 1.0);
    Hit hit = hit_on(first, path);
    if (LAYER_BEAUTY && VISIBLE_LIGHTS) add_lights(path, met ? hit.distance : FAR_DISTANCE);
    if (!met || kind_of(first) == KIND_DIFFUSE) add_end(path, met, hit, true, 0u);
    imageStore(picture, ivec2(pixel), vec4(radiance[0].rgb, 1.0));
}
