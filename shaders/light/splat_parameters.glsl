// What all shaders that draw splats are told.
layout(std140, binding = 0) uniform DrawParameters {
    vec2 atlas_size;
    vec2 table_u;  // texture u = table_u.x * xi + table_u.y
    uint bands;
    uint capacity;  // slots that are listed of each kind
    uint cumulative_samples;
    uint tables;  // layers of the texture; from bit 16 on: tables that lie one below the other in each
};
layout(std430, binding = 7) readonly buffer Curves {
    vec4 curve[];
};  // by light and class: density over x, or its running integral
