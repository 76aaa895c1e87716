// A swept splat whose band was cut at total internal reflection, so that no table was made for it: the difference of
// the light's running integral over x at two places.
#include "light/splat_texel.glsl"

#if CONTACT_LINES
flat in uint side;
#endif
flat in vec4 rect;
noperspective in vec3 at;
flat in vec3 shape;
noperspective in vec2 wave;
flat in vec3 ripple;
flat in vec4 throughput;
flat in vec4 band;  // x_lo, x_hi, half of the sweep in xi, 1 / (sqrt(2) sigma) in xi
flat in float curve_row;
layout(location = 0) out vec4 deposited[TARGETS];

void main() {
    float share = !inside_rect(gl_FragCoord.xy, rect)
        ? 0.0
        : swept_share(at, shape, wave, ripple, 1.0) / (2.0 * half_box_of(band));
    if (CONTACT_LINES) share *= taken_at(gl_FragCoord.xy, side);
    vec2 x = window_at(at.y, band);
    share *= throughput_over(vec4(0.5 * (x.x + x.y)), throughput).x;
    for (int g = 0; g < TARGETS; ++g) {
        deposited[g] = share * window_energy(curve_row, x, g);
    }
}
