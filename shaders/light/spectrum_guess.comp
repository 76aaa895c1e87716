// Spectral channels of a caustic map that holds a colour only: the smoothest spectrum of each texel's colour, as bright
// as that. For answers while something is dragged, where adding photons to every channel would take longer than a
// frame.
layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) readonly uniform image2D colours;
layout(rgba32f, binding = 1) writeonly uniform image2D spectral[SPECTRAL_TARGETS];
// Of four channels each: what they have of X, of Y and of Z, and the luminance of a watt in each.
struct Guess {
    vec4 of_x;
    vec4 of_y;
    vec4 of_z;
    vec4 luminance;
};
layout(std430, binding = 0) readonly restrict buffer Guesses { Guess guesses[SPECTRAL_TARGETS]; };

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, imageSize(colours)))) return;
    vec3 xyz = imageLoad(colours, texel).xyz;
    vec4 watts[SPECTRAL_TARGETS];
    float luminance = 0.0;
    for (int t = 0; t < SPECTRAL_TARGETS; ++t) {
        // Colours of few wavelengths ask for less than nothing of the others.
        watts[t] = max(guesses[t].of_x * xyz.x + guesses[t].of_y * xyz.y + guesses[t].of_z * xyz.z, vec4(0.0));
        luminance += dot(guesses[t].luminance, watts[t]);
    }
    float scale = luminance > 0.0 ? xyz.y / luminance : 0.0;
    for (int t = 0; t < SPECTRAL_TARGETS; ++t) imageStore(spectral[t], texel, scale * watts[t]);
}
