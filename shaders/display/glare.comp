// Veiling glare on the device (app/base/glare.py): a picture is shrunk by octaves, each octave's halo is spread on the way back, and the
// share that the lens scatters is put in place of as much of the picture. Which step this is: HALVE, SHRINK, SPREAD, SOFTEN or JOIN.
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D fine;     // black beyond its border
layout(binding = 1) uniform sampler2D coarse;   // likewise, softened
layout(rgba32f, binding = 0) uniform writeonly restrict image2D made;
uniform float share;

const float TENT[3] = float[3](0.25, 0.5, 0.25);

// Mean over a tent as wide as two texels to each side, about a texel; black beyond the border.
vec3 spread(sampler2D of, ivec2 texel)
{
    ivec2 size = textureSize(of, 0);
    vec3 sum = vec3(0.0);
    for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i) {
            ivec2 at = texel + ivec2(i, j) - 1;
            bool inside = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, size));
            sum += inside ? TENT[i] * TENT[j] * texelFetch(of, clamp(at, ivec2(0), size - 1), 0).rgb : vec3(0.0);
        }
    return sum;
}

// One lookup between texels that were softened first (SOFTEN) is the same as one for every part of the tent.
vec3 between_softened(sampler2D of, vec2 at)
{
    vec2 within = vec2(textureSize(of, 0) - 2);
    return textureLod(of, (at * within + 1.0) / (within + 2.0), 0.0).rgb;
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
