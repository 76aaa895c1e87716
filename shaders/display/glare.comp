// Veiling glare on the device (app/base/glare.py): a picture is shrunk by octaves, each octave's halo is spread on the way back, and the
// share that the lens scatters is put in place of as much of the picture. Which step this is: SHRINK, SPREAD or JOIN.
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D fine;     // black beyond its border
layout(binding = 1) uniform sampler2D coarse;   // likewise
layout(rgba32f, binding = 0) uniform writeonly restrict image2D made;
uniform float share;

const vec2 TENT[3] = vec2[3](vec2(-1.0, 0.25), vec2(0.0, 0.5), vec2(1.0, 0.25));

// Mean over a tent as wide as two texels to each side.
vec3 spread(sampler2D of, vec2 at)
{
    vec2 texel = 1.0 / vec2(textureSize(of, 0));
    vec3 sum = vec3(0.0);
    for (int j = 0; j < 3; ++j)
        for (int i = 0; i < 3; ++i)
            sum += TENT[i].y * TENT[j].y * textureLod(of, at + vec2(TENT[i].x, TENT[j].x) * texel, 0.0).rgb;
    return sum;
}

void main()
{
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy), size = imageSize(made);
    if (any(greaterThanEqual(texel, size))) return;
    vec2 at = (vec2(texel) + 0.5) / vec2(size);
#ifdef SHRINK
    // Taps that tile what the texel covers.
    ivec2 taps = max((textureSize(fine, 0) + size - 1) / size, ivec2(1));
    vec3 found = vec3(0.0);
    for (int j = 0; j < taps.y; ++j)
        for (int i = 0; i < taps.x; ++i)
            found += textureLod(fine, (vec2(texel) + (vec2(i, j) + 0.5) / vec2(taps)) / vec2(size), 0.0).rgb;
    found /= float(taps.x * taps.y);
#elif defined(SPREAD)
    vec3 found = share * spread(fine, at) + spread(coarse, at);
#else
    vec3 found = (1.0 - share) * texelFetch(fine, texel, 0).rgb + spread(coarse, at);
#endif
    imageStore(made, texel, vec4(found, 1.0));
}
