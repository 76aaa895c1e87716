// The hull of a beam polygon, grown to all texels it may touch.
layout(std140, binding = 0) uniform BeamDrawParameters {
    vec2 atlas_size;
    vec2 reserved;
};
in vec2 in_position;  // atlas texels
in uint in_polygon;
flat out uint polygon;

void main() {
    polygon = in_polygon;
    gl_Position = vec4(in_position / atlas_size * 2.0 - 1.0, 0.0, 1.0);
}
