// Energy that fell into a chart's gutter goes home across the seam. One thread a destination sums its gutter texels in
// a fixed order (no float atomics); with FILL, one thread a gutter texel copies back what lies across, for lookups.
layout(local_size_x = WORKGROUP) in;
layout(rgba32f, binding = 0) readonly uniform restrict image2D total;
layout(rgba32f, binding = 1) uniform restrict image2D resolved;
layout(std430, binding = 0) readonly buffer Homes {
    uvec4 homes[];
};  // x, y, first gutter texel, count; FILL: gutter x, y, home x, y
layout(std430, binding = 1) readonly buffer Gutters { uvec2 gutters[]; };
layout(std430, binding = 2) readonly buffer Ratios { float ratios[]; };
layout(location = 0) uniform uint count;

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) {
        return;
    }
    uvec4 home = homes[i];
    if (FILL) {
        imageStore(resolved, ivec2(home.xy), ratios[i] * imageLoad(resolved, ivec2(home.zw)));
    } else {
        vec4 sum = imageLoad(total, ivec2(home.xy));
        for (uint k = home.z; k < home.z + home.w; ++k) {
            sum += imageLoad(total, ivec2(gutters[k]));
        }
        imageStore(resolved, ivec2(home.xy), sum);
    }
}
