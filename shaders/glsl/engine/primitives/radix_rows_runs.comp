// As scan_rows.comp for the table of a radix pass, for CPUs: a row to a thread. Rows are short, and of a workgroup with one row most
// threads would wait.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/group.glsl"

// As many as fill a vector of a CPU.
const uint THREADS = 8;
layout(local_size_x = THREADS) in;
// Keys of a tile.
layout(constant_id = 0) const uint KEYS = 1024;

#include "engine/primitives/digits.glsl"

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) buffer Table { uint table[]; };
layout(binding = 2, std430) writeonly buffer Totals { uint totals[]; };

#include "engine/primitives/count.glsl"

// Elements that a loop takes at a time: some drivers end a loop after 65,535 turns.
const uint STEP = 8;

void main() {
    uint row = group_index() * THREADS + gl_LocalInvocationIndex, tiles = (element_count() + KEYS - 1) / KEYS, sum = 0;
    if (row > mask) return;
    for (uint first = 0; first < tiles; first += STEP) {
        [[unroll]] for (uint i = 0; i < STEP; ++i) {
            if (first + i < tiles) {
                uint here = table[row * stride + first + i];
                table[row * stride + first + i] = sum;
                sum += here;
            }
        }
    }
    totals[row] = sum;
}
