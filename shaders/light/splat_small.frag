// A splat smaller than a texel can show: an axis-aligned Gaussian, integrated exactly over each texel, of one colour.
#include "lib/gaussian.glsl"

#ifdef CONTACT_LINES
#include "lib/contact.glsl"
layout(binding = 1) uniform usampler2D contact_words;
flat in uint side;
#endif
flat in vec4 rect;
noperspective in vec2 at;
flat in vec2 half_texel;
flat in vec4 splat_colour[TARGETS];
layout(location = 0) out vec4 deposited[TARGETS];

void main() {
    // Clip distances would do, but llvmpipe loses triangles that two of them cut.
    bvec4 within = bvec4(greaterThan(gl_FragCoord.xy, rect.xy), lessThan(gl_FragCoord.xy, rect.zw));
    float share = !all(within) ? 0.0 : gaussian_box(at.x, half_texel.x) * gaussian_box(at.y, half_texel.y);
#ifdef CONTACT_LINES
    share *= takes_side(texelFetch(contact_words, ivec2(gl_FragCoord.xy), 0).x, side);
#endif
    for (int g = 0; g < TARGETS; ++g) {
        deposited[g] = share * splat_colour[g];
    }
}
