// The first surface of every pixel, by the rasteriser: a software renderer finds it twenty times as fast so as by a ray
// a pixel.
layout(std140, binding = BIND_PARAMETERS) uniform Parameters { CameraParameters p; };
#include "lib/moved.glsl"
layout(location = 0) in vec3 position;  // GPU space, where its object was packed
layout(location = 1) in uint primitive;  // as rays number it
layout(location = 2) in uint object;
layout(location = 0) uniform vec2 depths;  // nearest and farthest that is drawn, GPU units along `forward`
#if DISTANCES
out vec3 way_from_camera;
#else
flat out uvec2 seen;
#endif

void main() {
    vec4 at = vec4(position, 1.0);
    uint mover = object == 0xffffffffu ? 0u : object;
    vec3 stands = vec3(dot(place_row(mover, 0), at), dot(place_row(mover, 1), at), dot(place_row(mover, 2), at));
    vec3 way = stands - p.position;
    float depth = dot(way, p.forward);
    vec2 place =
        vec2(dot(way, p.half_right) / dot(p.half_right, p.half_right), dot(way, p.half_up) / dot(p.half_up, p.half_up));
    float span = depths.y - depths.x;
    if (DISTANCES) {
        way_from_camera = way;
    } else {
        seen = uvec2(primitive, object);
    }
    // Row 0 is the picture's top: no flip is needed where pictures are read by rows.
    gl_Position = p.orthographic != 0u
        ? vec4(place.x, -place.y, (2.0 * depth - depths.x - depths.y) / span, 1.0)
        : vec4(place.x, -place.y, ((depths.y + depths.x) * depth - 2.0 * depths.x * depths.y) / span, depth);
#if !DISTANCES
    if (object == 0xffffffffu) gl_Position = vec4(position, 1.0);  // beyond all
#endif
}
