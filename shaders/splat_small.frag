// A splat smaller than a texel can show: an axis-aligned Gaussian, integrated exactly over each texel, of one colour.
#include "lib/gaussian.glsl"

noperspective in vec2 at;
flat in vec4 box;
flat in vec4 splat_colour[TARGETS];
layout(location = 0) out vec4 deposited[TARGETS];

void main() {
    float share = gaussian_box(at.x, box.x) * gaussian_box(at.y, box.y);
    for (int g = 0; g < TARGETS; ++g) {
        deposited[g] = share * splat_colour[g];
    }
}
