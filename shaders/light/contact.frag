// 1: the receiver, 2: something close before it, 0: anything else.
in float height;
flat in uint is_receiver;
layout(location = 0) out uint seen;

void main()
{
    seen = is_receiver != 0u ? 1u : abs(height) < 1.0 ? 2u : 0u;
}
