// Exclusive prefix sum of every row of a table, in place, and the rows' totals. A workgroup walks along one row: rows
// are short (one element per block of thousands), so one level of blocks is all that a scan ever needs.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/group.glsl"

layout(local_size_x = 256, local_size_x_id = 0) in;

layout(push_constant) uniform Push {
    uint count;
    uint count_index;
    // Counted elements per element of a row.
    uint block;
    // Elements from one row to the next.
    uint stride;
    uint total_index;
};

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) buffer Rows { uint rows[]; };
layout(binding = 2, std430) writeonly buffer Totals { uint totals[]; };

#include "engine/primitives/count.glsl"
#define LINE uint
#include "engine/primitives/line_scan.glsl"

// Consecutive elements that a thread takes at a time: one 32-byte sector.
const uint RUN = 8;

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint row = group_index();
    uint length = (element_count() + block - 1) / block;
    uint carry = 0;
    for (uint chunk = 0; chunk < length; chunk += gl_WorkGroupSize.x * RUN) {
        uint first = chunk + thread * RUN;
        uint held[RUN];
        uint sum = 0;
        [[unroll]] for (uint i = 0; i < RUN; i++) {
            held[i] = first + i < length ? rows[row * stride + first + i] : 0;
            sum += held[i];
        }
        uint total;
        uint before = carry + line_scan(thread, sum, total);
        [[unroll]] for (uint i = 0; i < RUN; i++) {
            if (first + i < length) {
                rows[row * stride + first + i] = before;
            }
            before += held[i];
        }
        carry += total;
    }
    if (thread == 0) {
        totals[total_index + row] = carry;
    }
}
