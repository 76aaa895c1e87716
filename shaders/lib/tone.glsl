// Linear Rec.709 to what a display shows. Pure functions; app/base/tone_map.py tells why the first curve is as it is.
const float SHOULDER_START = 0.5;
const float BLEACH = 12.0;
const float GAMUT_KNEE = 0.8;

float luminance_709(vec3 rgb) { return dot(rgb, vec3(0.2126390, 0.7151687, 0.0721923)); }

// Σ c⁵
float fifth_powers(vec3 c) {
    vec3 square = c * c;
    return dot(square * square, c);
}

// (Σ c⁵)^(1/5) of non-negative channels.
float p_norm(vec3 c) {
    float largest = max(max(max(c.r, c.g), c.b), 1e-30);
    return largest * pow(fifth_powers(c / largest), 0.2);
}

// Towards the grey of the same luminance until no channel is negative; the border is rounded.
vec3 into_gamut(vec3 rgb) {
    float grey = max(luminance_709(rgb), 1e-30);
    float depth = p_norm(max(1.0 - rgb / grey, 0.0));
    float over = max(depth - GAMUT_KNEE, 0.0) / (1.0 - GAMUT_KNEE);
    float limited = min(depth, GAMUT_KNEE) + (1.0 - GAMUT_KNEE) * (over / (1.0 + over));
    return max(grey + limited / max(depth, 1e-30) * (rgb - grey), 0.0);
}

// Non-negative colours into [0, 1]: a hyperbolic shoulder on the norm, then bleaching far above white.
vec3 roll_off(vec3 rgb) {
    float norm = p_norm(rgb) * pow(3.0, -0.2);
    float over = max(norm - SHOULDER_START, 0.0) / (1.0 - SHOULDER_START);
    float shown = min(norm, SHOULDER_START) + (1.0 - SHOULDER_START) * (over / (1.0 + over));
    float share = over / (over + BLEACH);
    vec3 chroma = rgb * (shown / max(norm, 1e-30));
    vec3 display = chroma + share * sqrt(share) * (shown - chroma);
    return display / max(max(max(display.r, display.g), display.b), 1.0);
}

vec3 tone_spectrasplat(vec3 rgb) { return roll_off(into_gamut(rgb)); }

// Whether that leaves a finite colour as it is: well inside the gamut and below the shoulder, as most of most pictures
// is. Told without a root.
bool tone_keeps(vec3 rgb) {
    float start = fifth_powers(vec3(SHOULDER_START)), knee = fifth_powers(vec3(GAMUT_KNEE, 0.0, 0.0));
    vec3 depths = max(1.0 - rgb / max(luminance_709(rgb), 1e-30), 0.0);
    return fifth_powers(depths) <= knee && fifth_powers(rgb) <= start;
}

// Fit of the ACES reference and sRGB output transforms [Hill 2017], exposed so that middle grey stays.
vec3 tone_aces(vec3 rgb) {
    const mat3 IN = mat3(0.59719, 0.07600, 0.02840, 0.35458, 0.90834, 0.13383, 0.04823, 0.01566, 0.83777);
    const mat3 OUT = mat3(1.60475, -0.10208, -0.00327, -0.53108, 1.10813, -0.07276, -0.07367, -0.00605, 1.07602);
    vec3 v = min(max(IN * rgb * 1.8, 0.0), 1e6);
    vec3 fitted = (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.4329510) + 0.238081);
    return clamp(OUT * fitted, 0.0, 1.0);
}

// Extended global operator on luminance [Reinhard, Stark, Shirley, Ferwerda 2002, eq. 4]; display white is met at 8.
vec3 tone_reinhard(vec3 rgb) {
    float y = max(luminance_709(rgb), 0.0);
    return clamp(rgb * ((1.0 + y / 64.0) / (1.0 + y)), 0.0, 1.0);
}

// sRGB encoding (IEC 61966-2-1) of values in [0, 1].
vec3 srgb_encode(vec3 linear) {
    vec3 curve = 1.055 * pow(max(linear, 0.0031308), vec3(1.0 / 2.4)) - 0.055;
    return mix(curve, 12.92 * linear, lessThanEqual(linear, vec3(0.0031308)));
}

// Error of `shown` against `reference`, −∞ to ∞: the length of the difference over that of the reference (`floor_value`
// keeps it finite in the dark), with the sign of the difference in luminance.
float signed_error(vec3 shown, vec3 reference, float floor_value) {
    vec3 difference = shown - reference;
    float size = length(difference) / (length(reference) + floor_value);
    return luminance_709(difference) < 0.0 ? -size : size;
}
