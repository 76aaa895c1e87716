// total += scratch; what rounding kept out of the total stays in the scratch for the next time [Kahan 1965], so that
// the number of flushes does not matter.
layout(local_size_x = SIDE, local_size_y = SIDE) in;
layout(rgba32f, binding = 0) uniform restrict image2D scratch;
layout(rgba32f, binding = 1) uniform restrict image2D total;
uniform int first_row;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy) + ivec2(0, first_row);
    if (any(greaterThanEqual(at, imageSize(total)))) return;
    vec4 added = imageLoad(scratch, at);
    // Most of a map is dark.
    if (any(notEqual(added, vec4(0.0)))) {
        vec4 before = imageLoad(total, at);
        precise vec4 after = before + added;
        precise vec4 taken = after - before;
        precise vec4 kept_out = added - taken;
        imageStore(total, at, after);
        imageStore(scratch, at, kept_out);
    }
}
