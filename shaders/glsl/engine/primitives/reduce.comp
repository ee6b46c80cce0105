// Reduces blocks of elements to one element each, in an order that depends on the number of elements alone: a thread
// takes every 256th element of its block, one after the other; then a tree folds the 256 threads, halves first. A sum of
// floats therefore has the same bits in every run and for every subgroup size.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "shared/fold.glsl"
#include "shared/group.glsl"

layout(local_size_x = 256) in;

// The values of `Operation` in reduce.rs.
const uint SUM_F32 = 0;
const uint MIN_F32 = 1;
const uint MAX_F32 = 2;
const uint SUM_U32 = 3;
const uint MIN_U32 = 4;
const uint MAX_U32 = 5;
layout(constant_id = 0) const uint OPERATION = SUM_F32;

layout(push_constant) uniform Push {
    uint count;
    uint count_index;
    // Counted elements per element of `elements`: 1 for the input, the size of a block for a level of partials.
    uint divide;
    // Elements that a workgroup reduces.
    uint block;
    uint result_index;
};

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) readonly buffer Elements { uint elements[]; };
layout(binding = 2, std430) writeonly buffer Results { uint results[]; };

#include "engine/primitives/count.glsl"

shared uint folded[256];

uint identity() {
    switch (OPERATION) {
        case MIN_F32: return 0x7f800000u;
        case MAX_F32: return 0xff800000u;
        case MIN_U32: return 0xffffffffu;
        default: return 0;
    }
}

uint combine(uint a, uint b) {
    precise float sum = uintBitsToFloat(a) + uintBitsToFloat(b);
    switch (OPERATION) {
        case SUM_F32: return floatBitsToUint(sum);
        case MIN_F32: return floatBitsToUint(min(uintBitsToFloat(a), uintBitsToFloat(b)));
        case MAX_F32: return floatBitsToUint(max(uintBitsToFloat(a), uintBitsToFloat(b)));
        case SUM_U32: return a + b;
        case MIN_U32: return min(a, b);
        default: return max(a, b);
    }
}

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint total = element_count();
    uint available = total / divide + uint(total % divide != 0);
    uint first = group_index() * block;
    // The first workgroup always runs: what nothing reduces to is the identity.
    if (first >= available && group_index() > 0) {
        return;
    }
    uint end = first + min(block, available - first);
    uint value = identity();
    for (uint from = first + thread; from < end; from += 16 * 256) {
        uint held[16];
        [[unroll]] for (uint i = 0; i < 16; i++) {
            held[i] = from + 256 * i < end ? elements[from + 256 * i] : identity();
        }
        [[unroll]] for (uint i = 0; i < 16; i++) {
            value = combine(value, held[i]);
        }
    }
    folded[thread] = value;
    FOLD(thread, 256, folded[thread] = combine(folded[thread], folded[thread + apart]));
    if (thread == 0) {
        results[result_index + group_index()] = folded[0];
    }
}
