// A lattice of pixels of a picture, read back in one small piece: the whole picture would stall the frame.
layout(local_size_x = GROUP) in;
layout(binding = 0) uniform sampler2D picture;
layout(std430, binding = BIND_PIXELS) writeonly restrict buffer Pixels { vec4 pixels[]; };
uniform ivec2 lattice;

void main() {
    int index = int(gl_GlobalInvocationID.x);
    if (index >= lattice.x * lattice.y) return;
    ivec2 cell = ivec2(index % lattice.x, index / lattice.x);
    ivec2 size = textureSize(picture, 0);
    // The middle of the cell: the same pixels every time, so that an automatic exposure stands still.
    pixels[index] = texelFetch(picture, min(((2 * cell + 1) * size) / (2 * lattice), size - 1), 0);
}
