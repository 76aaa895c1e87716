// A sample of the even pixels: what a survey saw there is added, or the pixel is listed for the program that follows
// it. All others are listed for looks of their own, in camera.comp.
layout(local_size_x = 8, local_size_y = 8) in;

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { CameraParameters p; };
layout(rgba32f, binding = 0) uniform image2D picture;

#include "camera/listed.glsl"

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy + uvec2(0u, p.first_row);
    if (pixel.x >= p.size.x || pixel.y >= p.size.y) return;
    uint number = pixel.y * p.size.x + pixel.x, key = listed[survey_place(number)], sees = key & KIND_BITS;
    if ((key & IS_EVEN) == 0u) {
        uint at = atomicAdd(uneven_count, 1u);
        if (at % (UNEVEN_ROW * 64u) == 0u) atomicAdd(uneven_groups[1], 1u);
        listed[uneven_place(at)] = number;
        return;
    }
    if (sees == SEES_DIRECTLY || sees == SEES_COATED)
        imageStore(picture, ivec2(pixel), imageLoad(picture, ivec2(pixel)) + vec4(surveyed_mean(number), 0.0));
    if (FOLLOWED && (sees == SEES_SPECULAR || sees == SEES_COATED))
        list_entry(listed_entry(number, THE_SAMPLE, p.primary_samples));
}
