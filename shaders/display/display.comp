// Linear light to display pixels: exposure, tone curve or false colour, and two pictures side by side or as their
// error. Runs over the pixels of the output; row 0 is the top of both. SHOW and TONE are defines: a software renderer
// pays for both sides of every branch.
#include "lib/finite.glsl"
#include "lib/tone.glsl"
#include "lib/highlights.glsl"
#include "display/softened.glsl"

layout(local_size_x = 32, local_size_y = 8) in;
layout(binding = 0) uniform sampler2D shown;
layout(binding = 1) uniform sampler2D other;
layout(binding = 2) uniform sampler2D halo;
uniform float kept;
// `shown`, for a software renderer, whose `texelFetch` works out a mip level for every pixel.
layout(rgba32f, binding = 1) uniform readonly restrict image2D shown_image;
layout(rgba8, binding = 0) uniform writeonly restrict image2D display;
// A software renderer reads a storage buffer ray by ray, and took as long for that as for all the rest.
layout(std140, binding = 0) uniform Parameters { DisplayParameters parameters; };

void show(ivec2 pixel, vec3 colour) { imageStore(display, pixel, vec4(colour, 1.0)); }

const vec3 COLOURS[] = COLOUR_TABLE;
const float BRIGHTEST = 1e30;
const float LINE_HALF_PX = 1.0;
const vec3 NOT_FINITE = vec3(1.0, 0.0, 1.0);

// Mean of the picture over an output pixel: one lookup where the picture is enlarged, TAPS² where it is shrunk.
vec3 look(sampler2D picture, vec2 pixel) {
    if (AS_IMAGE) {
        return imageLoad(shown_image, ivec2(pixel)).rgb;
    } else if (SAME_SIZE) {
        return texelFetch(picture, ivec2(pixel), 0).rgb;
    } else if (TAPS == 1) {
        return textureLod(picture, parameters.origin + (pixel + 0.5) * parameters.step_uv, 0.0).rgb;
    } else {
        vec3 sum = vec3(0.0);
        for (int i = 0; i < TAPS * TAPS; ++i) {
            vec2 within = (vec2(i % TAPS, i / TAPS) + 0.5) / float(TAPS);
            sum += textureLod(picture, parameters.origin + (pixel + within) * parameters.step_uv, 0.0).rgb;
        }
        return sum / float(TAPS * TAPS);
    }
}

vec3 of_table(float place) {
    int last = COLOURS.length() - 1;
    float at = clamp(place, 0.0, 1.0) * float(last);
    int low = min(int(at), last - 1);
    return mix(COLOURS[low], COLOURS[low + 1], at - float(low));
}

vec3 false_colour(vec3 exposed) {
    float y = luminance_709(exposed);
    float stops = y > 0.0 ? log2(y) : -1e30;
    if (stops < parameters.false_stops.x) return vec3(0.0);
    if (stops > parameters.false_stops.y) return vec3(1.0);
    return of_table((stops - parameters.false_stops.x) / (parameters.false_stops.y - parameters.false_stops.x));
}

vec3 exposed(vec3 scene) { return clamp(clamp(scene, -BRIGHTEST, BRIGHTEST) * parameters.gain, -BRIGHTEST, BRIGHTEST); }

// Linear, as the display shows it.
vec3 toned(vec3 colour) {
    if (TONE_FALSE_COLOUR) {
        return false_colour(colour);
    } else if (TONE_SPECTRASPLAT) {
        return tone_spectrasplat(colour);
    } else if (TONE_ACES) {
        return tone_aces(colour);
    } else
        return TONE_REINHARD ? tone_reinhard(colour) : clamp(colour, 0.0, 1.0);
}

// What the picture has beside a pixel, so many of the larger of its pixels and the output's away; the border's go on
// beyond it.
vec3 scene_beside(sampler2D picture, vec2 pixel, ivec2 pixels) {
    if (AS_IMAGE) {
        return imageLoad(shown_image, clamp(ivec2(pixel) + pixels, ivec2(0), imageSize(shown_image) - 1)).rgb;
    } else if (SAME_SIZE) {
        return texelFetch(picture, clamp(ivec2(pixel) + pixels, ivec2(0), textureSize(picture, 0) - 1), 0).rgb;
    } else {
        vec2 half_uv = 0.5 * parameters.beside_px * parameters.step_uv;
        vec2 at = parameters.origin + (pixel + 0.5 + vec2(pixels) * parameters.beside_px) * parameters.step_uv;
        return look(picture, (clamp(at, half_uv, 1.0 - half_uv) - parameters.origin) / parameters.step_uv - 0.5);
    }
}

vec3 exposed_beside(sampler2D picture, vec2 pixel, ivec2 pixels) {
    vec3 scene = scene_beside(picture, pixel, pixels);
    return is_finite3(scene) ? exposed(scene) : vec3(0.0);
}

bool is_hot(vec3 scene) { return max(max(scene.r, scene.g), scene.b) * parameters.gain > STEP_WHITE; }

// The least among the next one, two and three pixels along a way from the one at `from`, of their norms' fifth powers:
// what is less has the lesser norm too, and none needs a root.
vec3 darkest_beyond(sampler2D picture, vec2 pixel, ivec2 from, ivec2 way) {
    float one = exposed_fifths(exposed_beside(picture, pixel, from + way));
    float two = min(one, exposed_fifths(exposed_beside(picture, pixel, from + 2 * way)));
    return vec3(one, two, min(two, exposed_fifths(exposed_beside(picture, pixel, from + 3 * way))));
}

// What is shown, linear, of the pixel so many beside this one: where a step runs through it, straight between both
// sides.
vec3 stepped(sampler2D picture, vec2 pixel, ivec2 at) {
    vec3 colour = exposed_beside(picture, pixel, at);
    PixelStep found = PixelStep(colour, colour, 0.0, 0.0, 0.0);
    for (int line = 0; line < 2; ++line) {
        ivec2 next = line == 0 ? ivec2(1, 0) : ivec2(0, 1);
        find_step(found, colour, exposed_beside(picture, pixel, at - 2 * next),
            exposed_beside(picture, pixel, at - next), exposed_beside(picture, pixel, at + next),
            exposed_beside(picture, pixel, at + 2 * next));
    }
    float share = step_share(found, exposed_norm(colour));
    vec3 mixture = toned(mix(found.dark, found.bright, share));
    return toned(colour) * step_factor(toned(found.bright), toned(found.dark), mixture, share, step_weight(found));
}

const ivec2 SIDES[4] = ivec2[](ivec2(1, 0), ivec2(0, 1), ivec2(-1, 0), ivec2(0, -1));

// Whether a pixel may be beside something small that is overexposed.
bool is_near_glint(sampler2D picture, vec2 pixel) {
    bool near = false;
    for (int side = 0; side < 4; ++side) {
        float bright = exposed_fifths(exposed_beside(picture, pixel, SIDES[side]));
        near = near || (bright > STEP_WHITE && darkest_beyond(picture, pixel, SIDES[side], SIDES[side]).z < STEP_WHITE);
    }
    return near && exposed_fifths(exposed_beside(picture, pixel, ivec2(0))) < STEP_WHITE;
}

// What such a pixel shows of the one beside it.
float share_of_side(sampler2D picture, vec2 pixel, ivec2 next) {
    float around =
        max(exposed_fifths(exposed_beside(picture, pixel, ivec2(0))), darkest_beyond(picture, pixel, next, next).z);
    for (int turn = -1; turn < 2; ++turn) {
        ivec2 way = next.yx + turn * next;
        around = max(
            around, end_of_run(darkest_beyond(picture, pixel, next, way), darkest_beyond(picture, pixel, next, -way)));
    }
    return glint_share(exposed_norm(exposed_beside(picture, pixel, next)), pow(around, 0.2));
}

vec3 developed(vec3 scene) {
    if (!is_finite3(scene)) return NOT_FINITE;
    vec3 shown = toned(exposed(scene));
    return TONE_FALSE_COLOUR ? shown : srgb_encode(shown);
}

vec3 error_colour(vec3 scene, vec3 reference) {
    if (!is_finite3(scene) || !is_finite3(reference)) return NOT_FINITE;
    float error = signed_error(scene * parameters.gain, reference * parameters.gain, parameters.error_floor);
    return of_table(0.5 + 0.5 * error / parameters.error_range);
}

vec3 wiped(vec2 pixel) {
    float from_line = pixel.x + 0.5 - parameters.wipe_px;
    vec3 colour = developed(from_line < 0.0 ? look(shown, pixel) : look(other, pixel));
    // A white line with a dark seam on both sides is seen over any picture.
    if (abs(from_line) <= LINE_HALF_PX) return vec3(1.0);
    return abs(from_line) <= LINE_HALF_PX + 1.0 ? 0.4 * colour : colour;
}

#ifdef ROWS
vec3 scene_at(ivec2 pixel) {
    vec3 scene = look(shown, vec2(pixel));
    if (HALO) scene = kept * scene + between_softened(halo, (vec2(pixel) + 0.5) * parameters.step_uv);
    return scene;
}

// Develops a pixel, or tells that the tone curve bends it: that takes as long as all the rest.
bool is_bent(ivec2 pixel, vec3 scene) {
    if (TONE_SPECTRASPLAT) {
        vec3 colour = exposed(scene);
        show(pixel, srgb_encode(clamp(colour, 0.0, 1.0)));
        return !(is_finite3(scene) && tone_keeps(colour));
    } else {
        show(pixel, developed(scene));
        return false;
    }
}

// A column of pixels. A software renderer runs both sides of an `if`, and a loop once at least: so those that need more
// than the others come in a loop of their own after all of them.
void main() {
    ivec2 first = ivec2(gl_GlobalInvocationID.xy) * ivec2(1, ROWS);
    int rows = min(ROWS, imageSize(display).y - first.y);
    if (first.x >= imageSize(display).x || rows <= 0) return;
    uint bent = 0u;
#if ANTIALIAS
    uint beside_hot = 0u;
    vec3 scene = look(shown, vec2(first));
    bool is_hot_above = is_hot(scene_beside(shown, vec2(first), ivec2(0, -1)));
    for (int row = 0; row < rows; ++row) {
        ivec2 pixel = first + ivec2(0, row);
        if (is_bent(pixel, scene)) bent |= 1u << uint(row);
        vec3 below = scene_beside(shown, vec2(pixel), ivec2(0, 1));
        bool hot = is_hot_above || is_hot(below) || is_hot(scene_beside(shown, vec2(pixel), ivec2(-1, 0)))
            || is_hot(scene_beside(shown, vec2(pixel), ivec2(1, 0)));
        if (hot && is_finite3(scene)) beside_hot |= 1u << uint(row);
        if (BESIDE_IS_NEXT) {
            is_hot_above = is_hot(scene);
            scene = below;
        } else {
            vec2 next = vec2(pixel + ivec2(0, 1));
            is_hot_above = is_hot(scene_beside(shown, next, ivec2(0, -1)));
            scene = look(shown, next);
        }
    }
    bent &= ~beside_hot;
#else
    for (int row = 0; row < rows; ++row) {
        ivec2 pixel = first + ivec2(0, row);
        if (is_bent(pixel, scene_at(pixel))) bent |= 1u << uint(row);
    }
#endif
    for (; bent != 0u; bent &= bent - 1u) {
        ivec2 pixel = first + ivec2(0, findLSB(bent));
        show(pixel, developed(scene_at(pixel)));
    }
    if (ANTIALIAS) {
        uint glints = 0u;
        for (; beside_hot != 0u; beside_hot &= beside_hot - 1u) {
            ivec2 pixel = first + ivec2(0, findLSB(beside_hot));
            show(pixel, srgb_encode(stepped(shown, vec2(pixel), ivec2(0))));
            if (is_near_glint(shown, vec2(pixel))) glints |= beside_hot & ~(beside_hot - 1u);
        }
        // One look a round, so that nothing but one is paid where there is no glint.
        vec3 own = vec3(0.0), result = vec3(0.0);
        for (int side = -1; glints != 0u;) {
            ivec2 pixel = first + ivec2(0, findLSB(glints)), next = side < 0 ? ivec2(0) : SIDES[side];
            vec3 there = stepped(shown, vec2(pixel), next);
            own = side < 0 ? there : own;
            result =
                side < 0 ? there : max(result, own + share_of_side(shown, vec2(pixel), next) * max(there - own, 0.0));
            if (side == 3) show(pixel, srgb_encode(result));
            glints = side == 3 ? glints & (glints - 1u) : glints;
            side = side == 3 ? -1 : side + 1;
        }
    }
}
#else
void main() {
    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(pixel, imageSize(display)))) return;
#if SHOW_ERROR
    vec3 colour = error_colour(look(shown, vec2(pixel)), look(other, vec2(pixel)));
#else
    vec3 colour = wiped(vec2(pixel));
#endif
    show(pixel, colour);
}
#endif
