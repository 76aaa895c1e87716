// What a beam's light, scattered once, adds to a pixel (photon beams, blur in one dimension [Jarosz et al. 2011]).
#include "lib/camera.glsl"
#include "lib/haze.glsl"

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { CameraParameters p; };
layout(std140, binding = BIND_HAZE) uniform HazeBlock { HazeParameters haze; };
layout(binding =
           UNIT_DISTANCES) uniform sampler2D distances;  // to what is seen directly, GPU units; two by two in a pixel

flat in vec4 beam_start;
flat in vec4 beam_direction;
flat in vec3 beam_first;
flat in vec3 spread[3];
flat in vec4 beam_flux[TARGETS];
layout(location = 0) out vec4 found[TARGETS];

// Share of the pixel in which nothing hides what lies so far from the camera.
float visible_share(ivec2 pixel, float distance) {
    vec4 first = textureGather(distances, vec2(2 * pixel + 1) / vec2(textureSize(distances, 0)));
    return dot(vec4(greaterThan(first, vec4(distance))), vec4(0.25));
}

void main() {
    bool orthographic = p.orthographic != 0u;
    CameraRay ray = camera_ray(vec3(0.0), p.forward, p.half_right, p.half_up, orthographic,
        picture_point(uvec2(gl_FragCoord.xy), vec2(0.5), p.size));
    BeamCrossing crossing = cross_beam(beam_start.xyz - ray.position, beam_direction.xyz, ray.direction);
    float along = crossing.on_beam;
    if (along < 0.0 || along > beam_start.w || crossing.on_ray <= 0.0) discard;

    vec2 u = vec2(dot(crossing.across, beam_first), dot(crossing.across, cross(beam_direction.xyz, beam_first)));
    vec3 covariance = spread[0] + along * (spread[1] + along * spread[2]);
    float pixel = haze.pixel * (orthographic ? 1.0 : crossing.on_ray);
    float deviation = sqrt(
        max(u.x * u.x * covariance.x + 2.0 * u.x * u.y * covariance.y + u.y * u.y * covariance.z, 0.0) + pixel * pixel);
    float density = blur_1d(crossing.offset, deviation);
    if (density <= 0.0) discard;

    float transmittance = exp(-haze.extinction * (beam_direction.w + along + crossing.on_ray));
    float scattered = haze.strength * henyey_greenstein(-crossing.cosine, haze.anisotropy) * transmittance;
    float radiance = scattered * density / crossing.sine * visible_share(ivec2(gl_FragCoord.xy), crossing.on_ray);
    for (int t = 0; t < TARGETS; ++t) found[t] = radiance * beam_flux[t];
}
