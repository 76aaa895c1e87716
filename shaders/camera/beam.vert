// A screen polygon's hull, grown so that it holds the middle of every pixel that it touches; see camera/beam.frag.
layout(std140, binding = BIND_BEAM_VIEW) uniform View { BeamView view; };

in vec2 in_place;  // pixels
in uint in_polygon;

flat out uint polygon;

void main()
{
    polygon = in_polygon;
    gl_Position = vec4(2.0 * in_place / view.size - 1.0, 0.0, 1.0);
}
