// Lights as a surface point sees them: where they are, how bright, and how they look when a ray
// runs into one. Pure functions; emission.glsl holds the way from the light outwards, spot.glsl
// the edge that both share.
#include "lib/emission.glsl"
#include "lib/spot.glsl"
#include "lib/profile.glsl"

#define LIGHT_KIND_POINT 0u
#define LIGHT_KIND_DIRECTIONAL 1u
#define LIGHT_KIND_COLLIMATED 2u
#define LIGHT_KIND_AREA 3u

// What one point of a light sends to a receiving point.
struct LightSample {
    vec3 toward;  // unit, from the receiving point to the light
    float distance;  // GPU units; FAR_DISTANCE for the sun
    float gain;  // irradiance across `toward` per unit of the light's own quantity
};

// `unit`: uniform in the unit square, used by lights of some extent.
LightSample sample_light(CameraLight light, vec3 position, vec2 unit) {
    LightSample s = LightSample(-light.axis, 1e30, 1.0);
    if (light.kind == LIGHT_KIND_DIRECTIONAL) {
        vec2 tilt = concentric_disc(unit);
        s.toward = -normalize(light.axis + tilt.x * light.half_u + tilt.y * light.half_v);
        return s;
    }
    vec3 target = light.position;
    if (light.kind == LIGHT_KIND_COLLIMATED) {
        vec3 from_aperture = position - light.position;
        float along = dot(from_aperture, light.axis);
        vec2 at = vec2(dot(from_aperture, light.half_u) / dot(light.half_u, light.half_u),
            dot(from_aperture, light.half_v) / dot(light.half_v, light.half_v));
        bool within = light.is_disc != 0u ? dot(at, at) <= 1.0 : max(abs(at.x), abs(at.y)) <= 1.0;
        s.distance = along;
        s.gain = within && along > 0.0 ? 1.0 : 0.0;
        return s;
    }
    if (light.kind == LIGHT_KIND_AREA) {
        vec2 on_light = light.is_disc != 0u ? concentric_disc(unit) : 2.0 * unit - 1.0;
        target += on_light.x * light.half_u + on_light.y * light.half_v;
    }
    vec3 way = target - position;
    s.distance = length(way);
    s.toward = way / max(s.distance, 1e-20);
    s.gain = 1.0 / max(s.distance * s.distance, 1e-20);
    s.gain *= light.kind == LIGHT_KIND_AREA ? light.measure * max(-dot(s.toward, light.axis), 0.0)
                                            : spot_falloff(-s.toward, light.axis, light.cone);
    if (LIGHT_PROFILES && light.has_profile != 0u)
        s.gain *= profile_intensity(light.profile, -s.toward, light.axis, light.half_u, light.half_v);
    return s;
}

// Share of a box of half width `blur` at `offset` from the middle of a stretch of half width `half_side`, its edges
// straightened; over all offsets it sums up to the stretch.
float stretch_seen(float offset, float half_side, float blur) {
    float reach = max(half_side, blur);
    return min(half_side / reach, 1.0)
        * clamp((reach + blur - abs(offset)) / max(2.0 * blur, 1e-9 * half_side), 0.0, 1.0);
}

// The same for a disc of radius 1 and a round look. The rim moves inwards as it softens, so that the disc's volume
// stays and its middle is as bright as it is; where the look is wider than that allows, a cone of the disc's volume.
float disc_seen(float offset, float blur) {
    bool slight = blur < 0.8660254;
    float rim = slight ? sqrt(1.0 - blur * blur * (1.0 / 3.0)) : blur;
    float height = slight ? 1.0 : 0.75 / (blur * blur);
    return height * clamp((rim + blur - offset) / max(2.0 * blur, 1e-9), 0.0, 1.0);
}

// How soft a look is (`blur`: half the width of what it stands for, in those of the light): up to twice as soft at a
// light hardly larger than that. Else but two or three looks have a part in it, and what they see of it in all depends
// on where it lies between them.
float softened(float blur) { return blur * (1.0 + clamp(4.0 * blur - 1.0, 0.0, 1.0)); }

// Radiance per unit of the light's own quantity that a ray meets within `far`: discs and
// rectangles from their front, the sun's disc where nothing else is met (far = 1e30).
// `width`: diameter of what the ray stands for, GPU units at its start and more of them per unit of distance: a light's
// edge is as soft.
float light_seen(CameraLight light, vec3 position, vec3 direction, float far, vec2 width) {
    if (light.kind == LIGHT_KIND_DIRECTIONAL) {
        float along = -dot(direction, light.axis);
        vec3 off = (direction + along * light.axis) / max(along, 1e-9);
        // half_u is as long as the tangent of the disc's angular radius.
        float radius = length(light.half_u);
        float seen =
            along > 0.0 && far >= 1e30 ? disc_seen(length(off) / radius, softened(0.5 * width.y / radius)) : 0.0;
        return seen * light.measure;
    }
    float facing = dot(direction, light.axis);
    float distance = dot(light.position - position, light.axis) / facing;
    if (light.kind != LIGHT_KIND_AREA || facing >= 0.0 || distance <= 0.0 || distance >= far) return 0.0;
    vec3 off = position + distance * direction - light.position;
    vec2 size = vec2(length(light.half_u), length(light.half_v));
    vec2 at = vec2(dot(off, light.half_u), dot(off, light.half_v)) / size;
    float blur = 0.5 * (width.x + distance * width.y);
    vec2 soft = vec2(softened(blur / size.x), softened(blur / size.y));
    return light.is_disc != 0u
        ? disc_seen(length(at) / size.x, soft.x)
        : stretch_seen(at.x, size.x, size.x * soft.x) * stretch_seen(at.y, size.y, size.y * soft.y);
}
