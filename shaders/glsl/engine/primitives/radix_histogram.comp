// Counts the digits of each tile of keys: `table[digit][tile]`. Order does not matter here, and additions of integers
// commute, so shared-memory atomics are deterministic; with a constant 1 the hardware folds equal digits by itself.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/group.glsl"

layout(local_size_x = 256, local_size_x_id = 0) in;

#include "engine/primitives/radix.glsl"

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) readonly buffer Keys { uint keys[]; };
layout(binding = 2, std430) writeonly buffer Table { uint table[]; };

#include "engine/primitives/count.glsl"

shared uint histogram[DIGITS];

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint available = element_count();
    uint tile = group_index();
    uint first = tile * TILE + thread;
    if (tile * TILE >= available) {
        return;
    }
    for (uint d = thread; d < DIGITS; d += gl_WorkGroupSize.x) {
        histogram[d] = 0;
    }
    uint held[ITEMS];
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint at = first + i * gl_WorkGroupSize.x;
        held[i] = at < available ? keys[at] : 0;
    }
    barrier();
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        if (first + i * gl_WorkGroupSize.x < available) {
            atomicAdd(histogram[digit(held[i])], 1);
        }
    }
    barrier();
    for (uint d = thread; d <= mask; d += gl_WorkGroupSize.x) {
        table[d * stride + tile] = histogram[d];
    }
}
