// Exclusive prefix sum inside blocks of 4096 elements, each on top of the sum of all blocks before it. A thread holds
// four runs of four consecutive elements; the four scans over the threads go through shared memory as one.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/group.glsl"

layout(local_size_x = 256) in;

layout(push_constant) uniform Push {
    uint count;
    uint count_index;
};

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) readonly buffer Elements { uint elements[]; };
layout(binding = 2, std430) readonly buffer Offsets { uint offsets[]; };
layout(binding = 3, std430) writeonly buffer Sums { uint sums[]; };

#include "engine/primitives/count.glsl"
#define LINE uvec4
#include "engine/primitives/line_scan.glsl"

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint available = element_count();
    uint first = group_index() * 4096;
    if (first >= available) {
        return;
    }
    first += thread * 4;
    uint held[4][4];
    uvec4 run_sums = uvec4(0);
    [[unroll]] for (uint run = 0; run < 4; run++) {
        [[unroll]] for (uint i = 0; i < 4; i++) {
            uint at = first + run * 1024 + i;
            held[run][i] = at < available ? elements[at] : 0;
            run_sums[run] += held[run][i];
        }
    }
    uvec4 totals;
    uvec4 before = line_scan(thread, run_sums, totals);
    uint offset = offsets[group_index()];
    [[unroll]] for (uint run = 0; run < 4; run++) {
        uint sum = offset + before[run];
        [[unroll]] for (uint i = 0; i < 4; i++) {
            uint at = first + run * 1024 + i;
            if (at < available) {
                sums[at] = sum;
            }
            sum += held[run][i];
        }
        offset += totals[run];
    }
}
