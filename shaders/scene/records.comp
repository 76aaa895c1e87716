// Records from the texels that the device keeps them in to what numpy reads, or back.
layout(local_size_x = WORKGROUP) in;
layout(std430, binding = 0) buffer Texels { uvec4 texels[]; };
layout(std430, binding = 1) buffer Records { RECORD records[]; };
uniform uint count;

#define LOAD(at) texels[at]
#define STORE(at, texel) texels[at] = texel

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) return;
    uint at = i * uint(RECORD_TEXELS);
#if PACKS
    RECORD record = records[i];
    RECORD_TO(STORE, at, record)
#else
    records[i] = RECORD_FROM(LOAD, at);
#endif
}
