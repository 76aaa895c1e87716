// Veiling glare on the device (app/base/glare.py): a picture is shrunk by octaves, each octave's halo is spread on the
// way back, and the share that the lens scatters is put in place of as much of the picture. Which step this is: HALVE,
// SHRINK, SPREAD, SOFTEN or JOIN.
#include "display/softened.glsl"

// Wide: a software renderer hands every group out by itself.
layout(local_size_x = 32, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D fine;  // black beyond its border
layout(binding = 1) uniform sampler2D coarse;  // likewise, softened
layout(rgba32f, binding = 0) uniform writeonly restrict image2D made;
// The finer picture as an image, which is black beyond its border too: a software renderer reads whole texels faster
// so.
layout(rgba32f, binding = 1) uniform readonly restrict image2D fine_texels;
uniform float share;

vec3 texel_at(ivec2 texel) { return imageLoad(fine_texels, texel).rgb; }

// Mean over a tent as wide as two texels to each side, about a texel.
vec3 spread(ivec2 texel) {
    vec3 corners =
        texel_at(texel - 1) + texel_at(texel + 1) + texel_at(texel + ivec2(1, -1)) + texel_at(texel + ivec2(-1, 1));
    vec3 sides = texel_at(texel - ivec2(1, 0)) + texel_at(texel + ivec2(1, 0)) + texel_at(texel - ivec2(0, 1))
        + texel_at(texel + ivec2(0, 1));
    return 0.0625 * corners + 0.125 * sides + 0.25 * texel_at(texel);
}

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(made);
    if (any(greaterThanEqual(texel, size))) return;
    vec2 at = (vec2(texel) + 0.5) / vec2(size);
#if HALVE
    ivec2 first = 2 * texel, last = min(first + 1, imageSize(fine_texels) - 1);
    vec3 found =
        0.25 * (texel_at(first) + texel_at(ivec2(last.x, first.y)) + texel_at(ivec2(first.x, last.y)) + texel_at(last));
#elif SHRINK
    // Taps that tile what the texel covers, so many that loops over them can be unrolled.
    vec3 found = vec3(0.0);
    for (int j = 0; j < TAPS_DOWN; ++j)
        for (int i = 0; i < TAPS_ACROSS; ++i)
            found +=
                textureLod(fine, (vec2(texel) + (vec2(i, j) + 0.5) / vec2(TAPS_ACROSS, TAPS_DOWN)) / vec2(size), 0.0)
                    .rgb;
    found /= float(TAPS_ACROSS * TAPS_DOWN);
#elif SPREAD
    vec3 found = share * spread(texel) + between_softened(coarse, at);
#elif SOFTEN
    // One texel wider all round than what is softened, since what lies beyond its border is lit by it too.
    vec3 found = spread(texel - 1);
#else
    vec3 found = (1.0 - share) * texel_at(texel) + between_softened(coarse, at);
#endif
    imageStore(made, texel, vec4(found, 1.0));
}
