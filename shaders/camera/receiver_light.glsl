// What a diffuse surface sends back of light that is known in coarse texels: the environment's
// (app/passes/environment_light.py) and that of other diffuse surfaces (app/passes/bounce_light.py), one irradiance.
#include "lib/covered.glsl"

// Irradiance, linear Rec.709, lm/unit².
layout(binding = UNIT_RECEIVER_LIGHT) uniform sampler2D known_light;

void add_receiver_light(Path path, SurfaceInteraction seen, WavelengthInterval interval) {
    bool back = dot(seen.direction, seen.normal_g) > 0.0;
    RayOrigin origin = RayOrigin(seen.primitive, seen.object, uint(back), 0u);
    vec3 light =
        receiver_light(known_light, seen.source, origin, seen.position, back ? -seen.normal_g : seen.normal_g).rgb;
    if (COATS || ROUGH_DIFFUSE) {
        // Of a measured reflectance its colour counts here.
        bool is_plain = receivers[object_at(seen.object).receiver].reflectance_class == 0u;
        vec3 colour = is_plain ? vec3(1.0) : seen.reflectance;
        seen.reflectance = base_albedo(seen, is_plain) * colour;
    }
    add_colour(path, interval, uint(WHITE_ROW), seen.reflectance * INVERSE_PI * light);
}
