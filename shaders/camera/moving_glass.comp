// A picture in motion, glass and mirrors: every pixel takes from the chosen ones round it what those of its own
// surface, facing as it does, have found.
layout(local_size_x = 64) in;

#include "camera/moving.glsl"
#include "camera/moving_lists.glsl"

layout(r32ui, binding = IMAGE_CHOSEN) uniform readonly restrict uimage2D chosen;
// Which way the chosen ones' surfaces face, and the objects that these are of.
layout(rgba32f, binding = IMAGE_FACING) uniform readonly restrict image2D facing;
layout(rgba32f, binding = IMAGE_FOUND) uniform readonly restrict image2D found;
#if COATS
layout(rgba32f, binding = IMAGE_PICTURE) uniform restrict image2D picture;
#else
layout(rgba32f, binding = IMAGE_PICTURE) uniform writeonly restrict image2D picture;
#endif

// What a neighbour on another facet counts: it is all there is where a block shows several.
const float OTHER_FACET = 2e-4;

// A quadratic B-spline about 0, in blocks: it ends, smoothly, where the block next but one begins. A weight that ended
// before that would draw the border of every block beside something much brighter.
float spline(float away) {
    float inner = 0.75 - away * away, outer = max(1.5 - away, 0.0);
    return away < 0.5 ? inner : 0.5 * outer * outer;
}

void main() {
    uint at = place_on_list();
    if (at >= specular_count) return;
    uvec2 pixel = pixel_of(specular_pixel(at)), first = seen_first(pixel);
    vec3 normal = facing_of(first, pixel);
    ivec2 block = ivec2(pixel / m.glass_step);
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 9; ++i) {
        ivec2 near = block + ivec2(i % 3, i / 3) - 1;
        bool inside = all(greaterThanEqual(near, ivec2(0))) && all(lessThan(near, ivec2(m.blocks)));
        uint best = inside ? imageLoad(chosen, near).x : NONE;
        if (best != NONE) {
            uvec2 at = pixel_of(bitfieldExtract(best, 0, NUMBER_BITS));
            vec4 other = imageLoad(facing, near);
            // From the block's middle, wherever in it the chosen pixel lies: so weights have no borders but the
            // spline's.
            vec2 away = abs((vec2(pixel) + 0.5) / float(m.glass_step) - (vec2(near) + 0.5));
            float alike = max(dot(other.xyz, normal), 0.0);
            for (int power = 2; power <= 16; power *= 2) alike *= alike;
            if (floatBitsToUint(other.w) != first.y) alike = 0.0;
            float weight = spline(away.x) * spline(away.y) * max(alike, OTHER_FACET);
            if (m.glass_step == 1u) weight = at == pixel ? 1.0 : 0.0;
            sum += weight * vec4(imageLoad(found, ivec2(at)).rgb, 1.0);
        }
    }
    vec3 followed = sum.rgb / max(sum.w, 1e-30);
    // A coat adds to its base.
    if (COATS && kind_of(first) == KIND_DIFFUSE) followed += imageLoad(picture, ivec2(pixel)).rgb;
    imageStore(picture, ivec2(pixel), vec4(followed, 1.0));
}
