// Veiling glare on the device (app/base/glare.py): a picture is shrunk by octaves, each octave's halo is spread on the way back, and the
// share that the lens scatters is put in place of as much of the picture. Which step this is: HALVE, SHRINK, SPREAD, SOFTEN or JOIN.
#include "display/softened.glsl"

// Wide: a software renderer hands every group out by itself.
layout(local_size_x = 32, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D fine;     // black beyond its border
layout(binding = 1) uniform sampler2D coarse;   // likewise, softened
layout(rgba32f, binding = 0) uniform writeonly restrict image2D made;
uniform float share;

// Mean over a tent as wide as two texels to each side, about a texel: of four lookups between texels, beyond whose border the sampler is black.
vec3 spread(sampler2D of, ivec2 texel)
{
    vec2 to_uv = 1.0 / vec2(textureSize(of, 0));
    vec2 low = vec2(texel) * to_uv, high = vec2(texel + 1) * to_uv;
    return 0.25 * (textureLod(of, low, 0.0).rgb + textureLod(of, vec2(high.x, low.y), 0.0).rgb
                   + textureLod(of, vec2(low.x, high.y), 0.0).rgb + textureLod(of, high, 0.0).rgb);
}

void main()
{
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(made);
    if (any(greaterThanEqual(texel, size))) return;
    vec2 at = (vec2(texel) + 0.5) / vec2(size);
#ifdef HALVE
    ivec2 first = 2 * texel, last = min(first + 1, textureSize(fine, 0) - 1);
    vec3 found = 0.25 * (texelFetch(fine, first, 0).rgb + texelFetch(fine, ivec2(last.x, first.y), 0).rgb
                         + texelFetch(fine, ivec2(first.x, last.y), 0).rgb + texelFetch(fine, last, 0).rgb);
#elif defined(SHRINK)
    // Taps that tile what the texel covers.
    ivec2 taps = max((textureSize(fine, 0) + size - 1) / size, ivec2(1));
    vec3 found = vec3(0.0);
    for (int j = 0; j < taps.y; ++j)
        for (int i = 0; i < taps.x; ++i)
            found += textureLod(fine, (vec2(texel) + (vec2(i, j) + 0.5) / vec2(taps)) / vec2(size), 0.0).rgb;
    found /= float(taps.x * taps.y);
#elif defined(SPREAD)
    vec3 found = share * spread(fine, texel) + between_softened(coarse, at);
#elif defined(SOFTEN)
    // One texel wider all round than what is softened, since what lies beyond its border is lit by it too.
    vec3 found = spread(fine, texel - 1);
#else
    vec3 found = (1.0 - share) * texelFetch(fine, texel, 0).rgb + between_softened(coarse, at);
#endif
    imageStore(made, texel, vec4(found, 1.0));
}
