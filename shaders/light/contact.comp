// The words of `lib/contact.glsl`, from what is seen in each part of a texel.
#include "lib/contact.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0) uniform usampler2D seen;
layout(r32ui, binding = 0) writeonly uniform restrict uimage2D words;
uniform ivec2 first;  // texel of the atlas
uniform ivec2 count;

void main() {
    ivec2 texel = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(texel, count))) return;
    uint word = 0u;
    for (uint part = 0u; part < CONTACT_PARTS * CONTACT_PARTS; ++part) {
        ivec2 at = texel * int(CONTACT_PARTS) + ivec2(part % CONTACT_PARTS, part / CONTACT_PARTS);
        uint what = texelFetch(seen, at, 0).x;
        word |= what == 1u ? 1u << part : what == 2u ? 1u << (part + 16u) : 0u;
    }
    imageStore(words, first + texel, uvec4(word));
}
