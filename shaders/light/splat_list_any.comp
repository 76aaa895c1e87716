// Lists the splats of each kind in any order: many photons at a time, for devices that add them in any order anyway.
// Each work group takes room in the list for all of its own at once. For the draws an entry is a splat's slot; where
// compute shaders add them (splat_add.comp), a splat has an entry a piece.
layout(local_size_x = WORKGROUP) in;

layout(std430, binding = 1) readonly buffer Splats { uvec4 splat_texels[]; };
layout(std430, binding = 7) buffer Commands { uint kind_words[]; };

#include "light/footprint_parameters.glsl"
#include "light/splat_pieces.glsl"
#include "light/splat_slots.glsl"

#if IN_PIECES
layout(std430, binding = 8) writeonly buffer Entries { uvec2 entries[]; };  // slot, piece
uniform uint entries_room;
#include "light/splat_entries.glsl"
#else
layout(std430, binding = 8) writeonly buffer Lists { uint lists[]; };  // `capacity` a kind
uniform uint capacity;
#endif

shared uint listed[KINDS];
shared uint begins[KINDS];

void main() {
    uint me = gl_LocalInvocationID.x, photon = gl_GlobalInvocationID.x;
    if (me < KINDS) listed[me] = 0u;
    barrier();
#if IN_PIECES
    uint at_once = pieces_an_entry();
#endif
    uint slot = photon * PHOTON_SLOTS, end = photon < photons_there() ? end_of(photon) : slot;
    for (uint s = slot; s < end; ++s) {
        uint word = kind_at(s);
#if IN_PIECES
        if (word > 0u) atomicAdd(listed[(word & 7u) - 1u], entries_of(word >> PIECES_BIT, at_once));
#else
        if (word > 0u) atomicAdd(listed[word - 1u], 1u);
#endif
    }
    barrier();
    if (me < KINDS) {
#if IN_PIECES
        begins[me] = first_entry(me, at_once) + atomicAdd(kind_words[KIND_WORDS * me + ENTRIES_AT], listed[me]);
        if (gl_WorkGroupID.x == 0u) {
            uint groups = (most_entries(me, at_once) + uint(TEAMS) - 1u) / uint(TEAMS);
            kind_words[KIND_WORDS * me] = min(groups, MOST_GROUPS);
        }
#else
        // Every kind's first word is the number of vertices.
        uint vertices = me == 0u ? 3u : 6u;
        begins[me] = capacity * me + atomicAdd(kind_words[5u * me], vertices * listed[me]) / vertices;
#endif
    }
    barrier();
    for (uint s = slot; s < end; ++s) {
        uint word = kind_at(s);
        if (word == 0u) continue;
#if IN_PIECES
        uint kind = (word & 7u) - 1u, pieces = word >> PIECES_BIT, count = entries_of(pieces, at_once);
        uint at = atomicAdd(begins[kind], count);
        for (uint e = 0u; e < count; ++e) entries[at + e] = uvec2(s, e * at_once);
#else
        lists[atomicAdd(begins[word - 1u], 1u)] = s;
#endif
    }
}
