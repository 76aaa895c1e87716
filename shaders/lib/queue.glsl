// The queue between two trace steps. Rays and photons lie in slots fixed by their parent; three
// small kernels list the living ones in order: count per chunk, scan, scatter. No atomics, so the
// order, and with it every float sum downstream, is the same on every run and for every batch.
#define CHUNK 64u

layout(std430, binding = BIND_OUTCOMES) readonly restrict buffer Outcomes { uvec4 outcomes[]; };
layout(std430, binding = BIND_COUNTS) restrict buffer Counts { ChunkCount counts[]; };
layout(std430, binding = BIND_STATE) restrict buffer StateBlock { QueueState state; };
layout(std430, binding = BIND_INDICES) restrict buffer Indices { uint indices[]; };
