// Linear light to display pixels: exposure, tone curve or false colour, and two pictures side by side or as their error.
// Runs over the pixels of the output; row 0 is the top of both. SHOW and TONE are defines: a software renderer pays for
// both sides of every branch.
#include "lib/finite.glsl"
#include "lib/tone.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D shown;
layout(binding = 1) uniform sampler2D other;
layout(rgba8, binding = 0) uniform writeonly restrict image2D display;
layout(std430, binding = 0) readonly restrict buffer Parameters { DisplayParameters parameters; };

const vec3 COLOURS[] = COLOUR_TABLE;
const float BRIGHTEST = 1e30;
const float LINE_HALF_PX = 1.0;
const vec3 NOT_FINITE = vec3(1.0, 0.0, 1.0);

// Mean of the picture over an output pixel: one lookup where the picture is enlarged, TAPS² where it is shrunk.
vec3 look(sampler2D picture, vec2 pixel)
{
#if TAPS == 1
    return textureLod(picture, parameters.origin + (pixel + 0.5) * parameters.step_uv, 0.0).rgb;
#else
    vec3 sum = vec3(0.0);
    for (int i = 0; i < TAPS * TAPS; ++i) {
        vec2 within = (vec2(i % TAPS, i / TAPS) + 0.5) / float(TAPS);
        sum += textureLod(picture, parameters.origin + (pixel + within) * parameters.step_uv, 0.0).rgb;
    }
    return sum / float(TAPS * TAPS);
#endif
}

vec3 of_table(float place)
{
    int last = COLOURS.length() - 1;
    float at = clamp(place, 0.0, 1.0) * float(last);
    int low = min(int(at), last - 1);
    return mix(COLOURS[low], COLOURS[low + 1], at - float(low));
}

vec3 false_colour(vec3 exposed)
{
    float y = luminance_709(exposed);
    float stops = y > 0.0 ? log2(y) : -1e30;
    if (stops < parameters.false_stops.x) return vec3(0.0);
    if (stops > parameters.false_stops.y) return vec3(1.0);
    return of_table((stops - parameters.false_stops.x) / (parameters.false_stops.y - parameters.false_stops.x));
}

vec3 developed(vec3 scene)
{
    if (!is_finite3(scene)) return NOT_FINITE;
    vec3 exposed = clamp(clamp(scene, -BRIGHTEST, BRIGHTEST) * parameters.gain, -BRIGHTEST, BRIGHTEST);
#ifdef TONE_FALSE_COLOUR
    return false_colour(exposed);
#elif defined(TONE_SPECTRASPLAT)
    return srgb_encode(tone_spectrasplat(exposed));
#elif defined(TONE_ACES)
    return srgb_encode(tone_aces(exposed));
#elif defined(TONE_REINHARD)
    return srgb_encode(tone_reinhard(exposed));
#else
    return srgb_encode(clamp(exposed, 0.0, 1.0));
#endif
}

vec3 error_colour(vec3 scene, vec3 reference)
{
    if (!is_finite3(scene) || !is_finite3(reference)) return NOT_FINITE;
    float error = signed_error(scene * parameters.gain, reference * parameters.gain, parameters.error_floor);
    return of_table(0.5 + 0.5 * error / parameters.error_range);
}

vec3 wiped(vec2 pixel)
{
    float from_line = pixel.x + 0.5 - parameters.wipe_px;
    vec3 colour = developed(from_line < 0.0 ? look(shown, pixel) : look(other, pixel));
    // A white line with a dark seam on both sides is seen over any picture.
    if (abs(from_line) <= LINE_HALF_PX) return vec3(1.0);
    return abs(from_line) <= LINE_HALF_PX + 1.0 ? 0.4 * colour : colour;
}

void main()
{
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(display)))) return;
#ifdef SHOW_ERROR
    vec3 colour = error_colour(look(shown, vec2(pixel)), look(other, vec2(pixel)));
#elif defined(SHOW_WIPE)
    vec3 colour = wiped(vec2(pixel));
#else
    vec3 colour = developed(look(shown, vec2(pixel)));
#endif
    imageStore(display, pixel, vec4(colour, 1.0));
}
