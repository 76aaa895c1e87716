// What each light gives to places on receivers straight on, as a factor on its own quantity: what these then send on to
// each other. Glass is in the way as everything else, for what it throws is in the caustic maps.
layout(local_size_x = 64) in;

#include "lib/intersect.glsl"
#include "lib/lattice.glsl"
#include "lib/lights.glsl"
#include "lib/random.glsl"
#include "light/place.glsl"

layout(std140, binding = BIND_PARAMETERS) uniform Parameters { BounceDirectParameters p; };
layout(std430, binding = BIND_PLACES) readonly restrict buffer Places { EnvironmentPlace places[]; };
layout(std430, binding = BIND_LIGHTS) readonly restrict buffer Lights { CameraLight lights[]; };
layout(std430, binding = BIND_GAINS) restrict buffer Gains { float gains[]; };

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= p.count) return;
    EnvironmentPlace place = places[id];
    CameraLight light = lights[p.light];
    RayOrigin origin = RayOrigin(place.primitive, place.object, place.inside, 0u);
    uint key = hash_combine(p.light, id);
    float sum = 0.0;
    for (uint i = p.first_sample; i < p.end_sample; ++i) {
        vec2 within = vec2(kronecker(i, PLASTIC_1, 0u), kronecker(i, PLASTIC_2, 0u));
        vec2 unit = vec2(kronecker(i, depth_generator(0u), key), kronecker(i, depth_generator(1u), hash_pcg(key)));
        vec3 position = position_in(place, within);
        LightSample s = sample_light(light, position, unit);
        float gain = s.gain * max(dot(s.toward, place.normal), 0.0);
        // Up to the light, less a hair so that a surface the light lies on does not hide it.
        if (gain > 0.0 && !intersect_any(position, s.toward, s.distance * 0.99999, origin)) sum += gain;
    }
    gains[p.light * p.count + id] += sum * p.share;
}
