// Which parts of texels on receivers something covers (app/passes/covered_places.py): those all of whose corners are
// covered, or none.
layout(local_size_x = 64) in;

#include "lib/covered.glsl"

layout(std430, binding = BIND_PLACES) readonly restrict buffer Places { EnvironmentPlace places[]; };
// Parts that are open, and covered, as bits; others are neither.
layout(std430, binding = BIND_PARTS) writeonly restrict buffer Parts { uvec2 parts[]; };
layout(binding = UNIT_RECORDS) uniform sampler2D records;

void main() {
    uint id = gl_GlobalInvocationID.x;
    if (id >= uint(places.length())) return;
    EnvironmentPlace place = places[id];
    RayOrigin origin = RayOrigin(place.primitive, place.object, place.inside, 0u);
    uvec2 found = uvec2(0xffffu);
    for (uint corner = 0u; corner < 25u; ++corner) {
        uvec2 at = uvec2(corner % 5u, corner / 5u);
        // A hair within, so that corners on a border of the receiver are on it.
        vec2 within = (0.5 - 0.0625 * 0.25) * (0.5 * vec2(at) - 1.0);
        vec3 position = place.position + within.x * place.span_u + within.y * place.span_v;
        bool covered = is_covered(records, origin, position, place.normal, NEAR_TEXELS * length(place.span_u));
        // Of the up to four parts about it.
        for (uint side = 0u; side < 4u; ++side) {
            ivec2 part = ivec2(at) - ivec2(side & 1u, side >> 1u);
            bool exists = all(greaterThanEqual(part, ivec2(0))) && all(lessThan(part, ivec2(4)));
            uint bit = exists ? 1u << uint(part.y * 4 + part.x) : 0u;
            if (covered)
                found.x &= ~bit;
            else
                found.y &= ~bit;
        }
    }
    parts[id] = found;
}
