// The sums of all targets become empty; those of one that `counts` go to its texture before.
layout(local_size_x = SIDE, local_size_y = SIDE) in;
layout(rgba32f, binding = 0) uniform restrict image2D total;

#include "light/splat_sums.glsl"

uniform ivec2 size;
uniform int target;
uniform uint counts;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, size))) {
        return;
    }
    int at = target + int(gl_GlobalInvocationID.z);
    if (counts != 0u) {
        vec4 added = sums_at(texel, size, at);
        // Most of a map is dark.
        if (any(notEqual(added, vec4(0.0)))) imageStore(total, texel, imageLoad(total, texel) + added);
    }
    uint place = place_in_sums(texel, size, at);
    for (uint channel = 0u; channel < 4u; ++channel) {
        splat_sums[place + channel * CHANNEL_STEP] = NOTHING;
    }
}
