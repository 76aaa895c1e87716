// Adds a window kept in wide texels (broad splats) to the same window in finer ones: bilinear between the centres of
// texels twice as wide, a quarter of their energy for each fine one; or all of a wide texel's parts have as much.
layout(local_size_x = 8, local_size_y = 8) in;

layout(rgba32f, binding = 0) uniform image2D maps;
layout(location = 0) uniform ivec4 wide;  // tile: x0, y0, x1, y1
layout(location = 1) uniform ivec4 fine;
layout(location = 2) uniform int even_parts;  // along a wide texel's side; 0: bilinear

vec4 wide_texel(ivec2 at) { return imageLoad(maps, wide.xy + clamp(at, ivec2(0), wide.zw - wide.xy - 1)); }

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, fine.zw - fine.xy))) return;
    vec4 sum = imageLoad(maps, fine.xy + texel);
    if (even_parts > 0) {
        imageStore(maps, fine.xy + texel, sum + wide_texel(texel / even_parts) / float(even_parts * even_parts));
        return;
    }
    vec2 at = (vec2(texel) + 0.5) * 0.5 - 0.5;
    ivec2 corner = ivec2(floor(at));
    vec2 share = at - vec2(corner);
    vec4 below = mix(wide_texel(corner), wide_texel(corner + ivec2(1, 0)), share.x);
    vec4 above = mix(wide_texel(corner + ivec2(0, 1)), wide_texel(corner + ivec2(1, 1)), share.x);
    imageStore(maps, fine.xy + texel, sum + mix(below, above, share.y) * 0.25);
}
