// The error function and integrals of Gaussians, for splats (share of a splat in a texel, soft ends of a sweep) and for
// hard edges of lights. Pure functions, no bindings.

const float SQRT_HALF = 0.70710678;
const float TWO_PI = 6.2831853;

// erf to 3e-7 without an exponential (Abramowitz and Stegun 1964, 7.1.28).
float erf_approx(float x) {
    float a = abs(x);
    float p = 1.0
        + a
            * (0.0705230784
                + a * (0.0422820123 + a * (0.0092705272 + a * (0.0001520143 + a * (0.0002765672 + a * 0.0000430638)))));
    p *= p;
    p *= p;
    p *= p;
    p *= p;
    return sign(x) * (1.0 - 1.0 / p);
}

// Integral of a normal density over [y - half_width, y + half_width]; arguments in units of sqrt(2) standard
// deviations.
float gaussian_box(float y, float half_width) {
    return 0.5 * (erf_approx(y + half_width) - erf_approx(y - half_width));
}

// gaussian_box to 5e-4 with one division (7.1.27). Errors cancel in the sum over adjacent boxes: energy is conserved.
// Beyond ALL_OF_IT the tail is negligible; clamping there keeps the powers of very wide boxes from overflowing.
const float ALL_OF_IT = 6.0;
float gaussian_box_fast(float y, float half_width) {
    vec2 x = clamp(vec2(y + half_width, y - half_width), -ALL_OF_IT, ALL_OF_IT);
    vec2 a = abs(x);
    vec2 p = 1.0 + a * (0.278393 + a * (0.230389 + a * (0.000972 + a * 0.078108)));
    p *= p;
    p *= p;
    vec2 side = vec2(x.x < 0.0 ? -0.5 : 0.5, x.y < 0.0 ? -0.5 : 0.5);
    return side.x - side.y - (side.x * p.y - side.y * p.x) / (p.x * p.y);
}

// 1 minus three cosine waves: it cancels the ripple of splats about a lattice. `cycles`: phases of two of the waves
// (the third has their sum), `heights`: amplitudes. A cubic stands in for the cosine, within 2 % of the amplitude.
float flatness(vec2 cycles, vec3 heights) {
    vec3 away = abs(fract(vec3(cycles, cycles.x + cycles.y)) * 2.0 - 1.0);
    return 1.0 - dot(heights, 2.0 * away * away * (3.0 - 2.0 * away) - 1.0);
}

// Mean excess E[max(Z - z, 0)] of a standard normal variable.
float normal_excess(float z) { return 0.39894228 * exp(-0.5 * z * z) - z * 0.5 * (1.0 - erf_approx(z * SQRT_HALF)); }

// sin(pi x) / (pi x)
float sinc_pi(float x) {
    float a = 3.14159265 * x;
    return abs(a) < 1e-2 ? 1.0 - a * a * (1.0 / 6.0) : sin(a) / a;
}
