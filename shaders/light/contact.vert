// What stands before a receiver, drawn as its map's camera sees it.
in vec3 position;  // GPU space
in uint object;
uniform mat4 to_clip;
uniform vec4 plane;  // the receiver's; its value at a place: how far that lies off, in units of what counts as close
uniform vec4 depth_row;  // its value at a place: 0 at the nearest depth that is drawn, 1 at the farthest
uniform float tie;  // what a later object lies behind one in the same place, in that depth
uniform uint receiver;
out float height;
out float depth;
flat out uint is_receiver;

void main() {
    height = dot(plane, vec4(position, 1.0));
    depth = dot(depth_row, vec4(position, 1.0)) + tie * float(object);
    is_receiver = object == receiver ? 1u : 0u;
    gl_Position = to_clip * vec4(position, 1.0);
}
