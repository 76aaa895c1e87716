// Pictures on surfaces and round the scene, filtered over the patch of them that a sample covers
// (app/gpu/texture_store.py packs them). Levels are packed by hand and the filter is written out here, so that
// every device shows the same picture: hardware filters differ, and know no environment with poles.
//
// The patch is a parallelogram with two derivative columns as sides. Its second moment is that of an ellipse, whose
// shorter axis chooses the level and whose longer one is covered with lookups side by side [McCormack et al. 1999].

#include "lib/optics.glsl"

layout(std430, binding = BIND_PICTURES) readonly restrict buffer Pictures {
    Picture pictures[PICTURE_COUNT];  // of textured objects, then of the environment
};
#if TEXTURES_IMAGE
layout(rgba32f, binding = UNIT_PICTURES) uniform readonly restrict image2D picture_texels;
#else
layout(binding = UNIT_PICTURES) uniform sampler2D picture_texels;
#endif

// Lookups along the longer axis at most; a longer patch is read from a coarser level.
const float MAX_TAPS = 8.0;
// A patch up to this much longer than wide is one lookup, and so much of a longer one falls to each.
const float ROUND_RATIO = 1.25;
// Interpolation between texels widens what a texel averages, so texels are this much smaller than the patch: the second
// moment of what is averaged is then the patch's own.
const float LEVEL_BIAS = -0.8;
// Texels of the sky are as wide as high only near its horizon; its patches are taken as this much wider, so that none
// aliases near a pole.
const float SKY_WIDER = 1.366;
// No column is longer than this many texels (or radians): squares must stay finite.
const float LONGEST = 1e8;

vec3 picture_texel(ivec2 at) {
    return TEXTURES_IMAGE ? imageLoad(picture_texels, at).rgb : texelFetch(picture_texels, at, 0).rgb;
}

// First texel of a level: 0, or one of the column to the right of it.
ivec2 level_origin(Picture picture, int level) {
    int height = int(picture.size.y);
    ivec2 aside = ivec2(int(picture.size.x), height - (height >> max(level - 1, 0)) + level - 1);
    return ivec2(picture.origin) + (level > 0 ? aside : ivec2(0));
}

// Bilinear interpolation in one level at `place`: (0, 0) is the picture's upper left corner, (1, 1) its lower right
// one.
vec3 level_bilinear(ivec2 origin, vec2 size, bvec2 repeats, vec2 place) {
    vec2 at = mix(clamp(place, 0.0, 1.0), place - floor(place), repeats) * size - 0.5;
    vec2 low = floor(at), high = low + 1.0, last = size - 1.0;
    vec2 share = at - low;
    low = mix(low, mix(vec2(0.0), last, repeats), lessThan(low, vec2(0.0)));
    high = mix(high, mix(last, vec2(0.0), repeats), greaterThan(high, last));
    ivec2 a = origin + ivec2(low), b = origin + ivec2(high);
    vec3 above = mix(picture_texel(a), picture_texel(ivec2(b.x, a.y)), share.x);
    vec3 below = mix(picture_texel(ivec2(a.x, b.y)), picture_texel(b), share.x);
    return mix(above, below, share.y);
}

// Axes of the ellipse that has the second moment of a parallelogram, from its sides' products s·s, s·t, t·t:
// lengths, and the longer one as a combination of the sides.
void patch_axes(float ss, float st, float tt, out float longer, out float shorter, out vec2 mixing) {
    float half_difference = 0.5 * (ss - tt);
    float radius = sqrt(half_difference * half_difference + st * st);
    float longer2 = 0.5 * (ss + tt) + radius;
    longer = sqrt(longer2);
    shorter = sqrt(max(ss * tt - st * st, 0.0) / max(longer2, 1e-30));
    mixing = half_difference >= 0.0 ? vec2(half_difference + radius, st) : vec2(st, radius - half_difference);
    mixing *= inversesqrt(max(dot(mixing, mixing), 1e-30));
}

// How a patch with these axes (texels of level 0) is read: from which level, with how many lookups.
void filter_plan(float longer, float shorter, out float level, out float taps) {
    float width = max(max(shorter, longer / (MAX_TAPS * ROUND_RATIO)), 1.0);
    taps = clamp(ceil(longer / (ROUND_RATIO * width)), 1.0, MAX_TAPS);
    level = max(log2(width) + LEVEL_BIAS, 0.0);
}

#if TEXTURES_IMAGE
layout(rgba32f, binding = UNIT_CORNERS) uniform readonly restrict image2D corner_texels;
#else
layout(binding = UNIT_CORNERS) uniform sampler2D corner_texels;
#endif

vec4 corner_texel(uint i) {
    ivec2 at = ivec2(int(i & 4095u), int(i >> 12u));
    return TEXTURES_IMAGE ? imageLoad(corner_texels, at) : texelFetch(corner_texels, at, 0);
}

// Texture coordinates, v upwards, at barycentric weights of the second and third corner of triangle `source`.
void hit_uv(Picture picture, uint source, vec2 bary, out vec2 uv) {
    vec4 first = corner_texel(picture.corners + 2u * source);
    vec4 second = corner_texel(picture.corners + 2u * source + 1u);
    uv = first.xy + bary.x * first.zw + bary.y * second.xy;
}

// Gradients of the texture coordinates in the triangle's plane, for its edges as the scene's records hold them.
void uv_gradients(Picture picture, uint source, vec3 edge1, vec3 edge2, out vec3 gradient_u, out vec3 gradient_v) {
    vec2 along1 = corner_texel(picture.corners + 2u * source).zw;
    vec2 along2 = corner_texel(picture.corners + 2u * source + 1u).xy;
    vec3 gradient1, gradient2;
    barycentric_gradients(edge1, edge2, gradient1, gradient2);
    gradient_u = along1.x * gradient1 + along2.x * gradient2;
    gradient_v = along1.y * gradient1 + along2.y * gradient2;
}

// Mean colour about `uv` (v upwards) over the parallelogram with these sides, in texture coordinates.
vec3 texture_filtered(Picture picture, vec2 uv, vec2 duv_ds, vec2 duv_dt) {
    vec2 size = vec2(picture.size);
    vec2 side_s = clamp(duv_ds * size, -LONGEST, LONGEST), side_t = clamp(duv_dt * size, -LONGEST, LONGEST);
    float longer, shorter, level, taps;
    vec2 mixing;
    patch_axes(dot(side_s, side_s), dot(side_s, side_t), dot(side_t, side_t), longer, shorter, mixing);
    filter_plan(longer, shorter, level, taps);
    vec2 place = vec2(uv.x, 1.0 - uv.y);
    vec2 along = (mixing.x * side_s + mixing.y * side_t) / (taps * size) * vec2(1.0, -1.0);
    place -= 0.5 * (taps - 1.0) * along;

    bvec2 repeats = notEqual(picture.repeats, uvec2(0u));
    int last = int(picture.levels) - 1;
    int fine = min(int(level), last);
    float coarse_share = fine < last ? level - float(fine) : 0.0;
    vec3 sum = vec3(0.0);
    // A loop that few take ends early on a software renderer too, where both sides of an `if` are run.
    int levels = coarse_share > 0.0 ? 2 : 1;
    for (int i = 0; i < levels; ++i) {
        ivec2 origin = level_origin(picture, fine + i);
        vec2 level_size = vec2(max(ivec2(picture.size) >> (fine + i), ivec2(1)));
        vec3 level_sum = vec3(0.0);
        vec2 at = place;
        for (int tap = 0; tap < int(taps); ++tap) {
            level_sum += level_bilinear(origin, level_size, repeats, at);
            at += along;
        }
        sum += (i == 0 ? 1.0 - coarse_share : coarse_share) * level_sum;
    }
    return sum / taps;
}

// Where a direction (of any length) lies on a latitude-longitude picture, v downwards; anywhere between at a pole.
vec2 environment_place(vec3 direction) {
    float flat_length = length(direction.xy);
    float azimuth = flat_length > 0.0 ? atan(direction.y, direction.x) : 0.0;
    return vec2(0.5 - azimuth * 0.15915494309, atan(flat_length, direction.z) * 0.31830988618);
}

// Mean radiance of the environment about a unit direction, over the patch of directions with these sides, rad.
//
// Lookups lie side by side on the sphere, not on the picture: each finds its own place, so that seam and poles need no
// care. Texels below level 0 are about as wide as high on the sphere (mip_chain.py), so the height of the picture
// alone says which level is as coarse as the patch.
vec3 environment_radiance(vec3 direction, vec3 ddirection_ds, vec3 ddirection_dt) {
    Picture picture = pictures[PICTURE_COUNT - 1];
    float texels_per_rad = float(picture.size.y) * 0.31830988618;
    vec3 side_s = clamp(ddirection_ds, -4.0, 4.0), side_t = clamp(ddirection_dt, -4.0, 4.0);
    float longer, shorter, level, taps;
    vec2 mixing;
    patch_axes(dot(side_s, side_s), dot(side_s, side_t), dot(side_t, side_t), longer, shorter, mixing);
    filter_plan(SKY_WIDER * longer * texels_per_rad, SKY_WIDER * shorter * texels_per_rad, level, taps);
    vec3 along = (mixing.x * side_s + mixing.y * side_t) / taps;
    direction -= 0.5 * (taps - 1.0) * along;

    int last = int(picture.levels) - 1;
    int fine = min(int(level), last);
    float coarse_share = fine < last ? level - float(fine) : 0.0;
    int levels = coarse_share > 0.0 ? 2 : 1;
    vec3 sum = vec3(0.0);
    for (int tap = 0; tap < int(taps); ++tap) {
        vec2 place = environment_place(direction);
        for (int i = 0; i < levels; ++i) {
            vec2 level_size = vec2(max(ivec2(picture.size) >> (fine + i), ivec2(1)));
            vec3 value = level_bilinear(level_origin(picture, fine + i), level_size, bvec2(true, false), place);
            sum += (i == 0 ? 1.0 - coarse_share : coarse_share) * value;
        }
        direction += along;
    }
    return sum / taps;
}
