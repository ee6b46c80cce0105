// Counts the digits of all keys, for all passes of a sort at once, and empties the first pass's entries of `states`. Order does not
// matter here, and additions of integers commute, so atomics are deterministic.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/group.glsl"

layout(local_size_x = 256, local_size_x_id = 0) in;

#include "engine/primitives/sweep.glsl"

layout(push_constant) uniform Push {
    uint count;
    uint count_index;
    // Bits that keys are sorted by, and of a digit.
    uint bits;
    uint width;
    // Tiles that a workgroup counts.
    uint tiles;
    // Lines of `states` before those of tiles.
    uint groups;
};

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) readonly buffer Keys { uint keys[]; };
layout(binding = 2, std430) buffer Header { uint header[]; };
layout(binding = 3, std430) writeonly buffer States { uint states[]; };

#include "engine/primitives/count.glsl"

shared uint histogram[PASSES * DIGITS];

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint available = element_count();
    uint tile = group_index() * tiles;
    if (tile * TILE >= available) {
        return;
    }
    for (uint d = thread; d < PASSES * DIGITS; d += gl_WorkGroupSize.x) {
        histogram[d] = 0;
    }
    uint masks[PASSES];
    [[unroll]] for (uint pass = 0; pass < PASSES; pass++) {
        uint shift = pass * width;
        masks[pass] = shift < bits ? (1 << min(width, bits - shift)) - 1 : 0;
    }
    barrier();
    for (uint end = tile + tiles; tile < end && tile * TILE < available; tile++) {
        for (uint d = thread; d < DIGITS; d += gl_WorkGroupSize.x) {
            states[(groups + tile) * DIGITS + d] = 0;
            if (tile % GROUP == 0) {
                states[(tile / GROUP + 1) * DIGITS + d] = 0;
            }
            if (tile == 0) {
                states[d] = 0;
            }
        }
        uint first = tile * TILE + thread;
        uint held[ITEMS];
        [[unroll]] for (uint i = 0; i < ITEMS; i++) {
            uint at = first + i * gl_WorkGroupSize.x;
            held[i] = at < available ? keys[at] : 0;
        }
        [[unroll]] for (uint i = 0; i < ITEMS; i++) {
            if (first + i * gl_WorkGroupSize.x < available) {
                [[unroll]] for (uint pass = 0; pass < PASSES; pass++) {
                    if (masks[pass] > 0) {
                        atomicAdd(histogram[pass * DIGITS + ((held[i] >> (pass * width)) & masks[pass])], 1);
                    }
                }
            }
        }
    }
    barrier();
    for (uint d = thread; d < PASSES * DIGITS; d += gl_WorkGroupSize.x) {
        if (histogram[d] > 0) {
            atomicAdd(header[TOTALS + d], histogram[d]);
        }
    }
}
