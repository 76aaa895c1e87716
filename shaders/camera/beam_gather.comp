// What was found by beams, added to the picture pixel by pixel, in the order of the polygons.
layout(local_size_x = 64) in;

// x: pixel; y, z: first and end of its entries in `order`.
layout(std430, binding = BIND_BEAM_RUNS) readonly restrict buffer Runs { uvec4 runs[]; };
layout(std430, binding = BIND_BEAM_ORDER) readonly restrict buffer Order { uint order[]; };
layout(std430, binding = BIND_BEAM_FOUND) readonly restrict buffer Found { vec4 found[]; };
layout(rgba32f, binding = 0) uniform image2D picture[TARGETS];
layout(location = 0) uniform uint run_count;

void main()
{
    if (gl_GlobalInvocationID.x >= run_count) return;
    uvec4 run = runs[gl_GlobalInvocationID.x];
    uint width = uint(imageSize(picture[0]).x);
    ivec2 pixel = ivec2(run.x % width, run.x / width);
    for (int t = 0; t < TARGETS; ++t) {
        vec4 sum = imageLoad(picture[t], pixel);
        for (uint i = run.y; i < run.z; ++i) sum += found[order[i] * uint(TARGETS) + uint(t)];
        imageStore(picture[t], pixel, sum);
    }
}
