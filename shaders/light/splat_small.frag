// A splat smaller than a texel can show: an axis-aligned Gaussian, integrated exactly over each texel, of one colour.
#include "light/splat_texel.glsl"

flat in uint side;
flat in vec4 rect;
noperspective in vec2 at;
flat in vec2 half_texel;
flat in vec4 splat_colour[TARGETS];
layout(location = 0) out vec4 deposited[TARGETS];

void main() {
    // Clip distances would do, but llvmpipe loses triangles that two of them cut.
    float share = !inside_rect(gl_FragCoord.xy, rect) ? 0.0 : small_share(at, half_texel);
    if (CONTACT_LINES) share *= taken_at(gl_FragCoord.xy, side);
    for (int g = 0; g < TARGETS; ++g) {
        deposited[g] = share * splat_colour[g];
    }
}
