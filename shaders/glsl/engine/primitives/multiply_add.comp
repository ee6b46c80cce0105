#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Computes as fast as the device can: the reference for other stages' arithmetic. Eight chains of multiply-adds per thread, of which
// none waits for another, in registers alone. Twin: src/engine/primitives/twin.rs.
#include "shared/group.glsl"
layout(local_size_x = 256) in;
// Factor and addend are unknown to the compiler, which cannot shorten the chains.
layout(push_constant) uniform Push { uint count; uint rounds; float factor; float addend; };
layout(binding = 0, std430) writeonly buffer Target { float target[]; };

// Multiply-adds of a chain in a round. Long rounds hide what the loop costs, and keep it under the 65,535 iterations of lavapipe.
const uint STEPS = 32;

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i >= count) return;
    vec4 low = float(i % 256) + vec4(0.0, 1.0, 2.0, 3.0);
    vec4 high = low + 4.0;
    for (uint round = 0; round < rounds; ++round) {
        [[unroll]] for (uint s = 0; s < STEPS; ++s) {
            low = fma(low, vec4(factor), vec4(addend));
            high = fma(high, vec4(factor), vec4(addend));
        }
    }
    vec4 both = low + high;
    target[i] = (both.x + both.y) + (both.z + both.w);
}
