// A picture drawn once for a view, added to the camera's sums with every sample.
layout(binding = 0) uniform sampler2D shown[TARGETS];
layout(location = 0) out vec4 found[TARGETS];

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    found[0] = texelFetch(shown[0], pixel, 0);
    if (TARGETS > 1) found[1] = texelFetch(shown[1], pixel, 0);
    if (TARGETS > 2) found[2] = texelFetch(shown[2], pixel, 0);
    if (TARGETS > 3) found[3] = texelFetch(shown[3], pixel, 0);
    if (TARGETS > 4) found[4] = texelFetch(shown[4], pixel, 0);
    if (TARGETS > 5) found[5] = texelFetch(shown[5], pixel, 0);
    if (TARGETS > 6) found[6] = texelFetch(shown[6], pixel, 0);
    if (TARGETS > 7) found[7] = texelFetch(shown[7], pixel, 0);
}
