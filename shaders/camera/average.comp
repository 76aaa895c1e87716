// Sums over camera samples → their mean, the picture that is shown.
layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) readonly uniform image2D sums;
layout(rgba32f, binding = 1) writeonly uniform image2D picture;
layout(location = 0) uniform float scale;

void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(sums)))) return;
    imageStore(picture, pixel, vec4(scale * imageLoad(sums, pixel).rgb, 1.0));
}
