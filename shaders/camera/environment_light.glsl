// What a diffuse surface sends back of the environment's light: the irradiance that app/passes/environment_light.py found, one texture
// that begins with records of where each receiver's texels lie.
#ifndef CAMERA_ENVIRONMENT_LIGHT_GLSL
#define CAMERA_ENVIRONMENT_LIGHT_GLSL

layout(binding = UNIT_ENVIRONMENT_LIGHT) uniform sampler2D environment_light;

vec4 environment_record(uint i)
{
    int width = textureSize(environment_light, 0).x;
    return texelFetch(environment_light, ivec2(int(i) % width, int(i) / width), 0);
}

// Irradiance of one side of a receiver, linear Rec.709, lm/unit².
vec3 environment_irradiance(uint receiver, uint source, vec3 position, bool back)
{
    vec4 head = environment_record(receiver);
    vec3 found = vec3(0.0);
    bool charts = head.z > 0.0;
    uint record = uint(head.x) + (back && head.w > 1.0 ? 3u * uint(head.y) : 0u);
    if (charts) record += 3u * (source + 1u - uint(head.z));
    int windows = charts ? 1 : int(head.y);
    bool lit = head.y > 0.0 && (!back || head.w > 1.0);
    for (int level = 0; level < windows && lit; ++level) {
        vec4 row_u = environment_record(record), row_v = environment_record(record + 1u), rect = environment_record(record + 2u);
        vec2 texel = vec2(dot(row_u.xyz, position) + row_u.w, dot(row_v.xyz, position) + row_v.w);
        bool holds = all(greaterThanEqual(texel, rect.xy)) && all(lessThan(texel, rect.zw));
        record += 3u;
        if (holds || level + 1 == windows) {
            vec2 at = clamp(texel - 0.5, rect.xy, rect.zw - 1.0);
            ivec2 low = ivec2(at), high = min(low + 1, ivec2(rect.zw) - 1);
            vec2 share = at - vec2(low);
            vec3 below = mix(texelFetch(environment_light, low, 0).rgb, texelFetch(environment_light, ivec2(high.x, low.y), 0).rgb, share.x);
            vec3 above = mix(texelFetch(environment_light, ivec2(low.x, high.y), 0).rgb, texelFetch(environment_light, high, 0).rgb, share.x);
            found = mix(below, above, share.y);
            lit = false;
        }
    }
    return found;
}

void add_environment_light(CameraPath path, SurfaceInteraction seen, WavelengthInterval interval)
{
    bool back = dot(seen.direction, seen.normal_g) > 0.0;
    vec3 light = environment_irradiance(object_at(seen.object).receiver, seen.source, seen.position, back);
    add_colour(path, interval, uint(WHITE_ROW), seen.reflectance * INVERSE_PI * light);
}

#endif
