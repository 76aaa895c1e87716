// 1: the receiver, 2: something close before it, 0: anything else.
in float height;
in float depth;
flat in uint is_receiver;
layout(location = 0) out uint seen;

void main() {
    // Even over the range: by the projection's own depth a face a hundredth behind a wall hides that in places, seen
    // from inside the glass.
    gl_FragDepth = clamp(depth, 0.0, 1.0);
    seen = is_receiver != 0u ? 1u : abs(height) < 1.0 ? 2u : 0u;
}
