// total += scratch, and the scratch is emptied in the same pass.
layout(local_size_x = SIDE, local_size_y = SIDE) in;
layout(rgba32f, binding = 0) uniform restrict image2D scratch;
layout(rgba32f, binding = 1) uniform restrict image2D total;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(total)))) {
        return;
    }
    imageStore(total, at, imageLoad(total, at) + imageLoad(scratch, at));
    imageStore(scratch, at, vec4(0.0));
}
