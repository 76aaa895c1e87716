// What compute shaders added to the sums of a target goes to its texture, and the sums are empty again.
layout(local_size_x = SIDE, local_size_y = SIDE) in;
layout(rgba32f, binding = 0) uniform restrict image2D drawn_into;

#include "light/splat_sums.glsl"

uniform int target;
uniform uint counts;  // 0: what is there is forgotten

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(drawn_into);
    if (any(greaterThanEqual(texel, size))) {
        return;
    }
    uint place = place_in_sums(texel, size, target);
    vec4 added = vec4(sum_at(place), sum_at(place + CHANNEL_STEP), sum_at(place + 2u * CHANNEL_STEP),
        sum_at(place + 3u * CHANNEL_STEP));
    // Most of a map is dark.
    if (any(notEqual(added, vec4(0.0)))) {
        if (counts != 0u) {
            imageStore(drawn_into, texel, imageLoad(drawn_into, texel) + added);
        }
        for (uint channel = 0u; channel < 4u; ++channel) {
            splat_sums[place + channel * CHANNEL_STEP] = NOTHING;
        }
    }
}
