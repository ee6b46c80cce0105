// As radix_scatter.comp, for CPUs: a thread moves the keys of a run of its own (and their values) one after another. There every
// ballot and barrier costs, and keys need not be written beside one another.
#version 450
#extension GL_GOOGLE_include_directive : require
#include "shared/group.glsl"

// As many as fill a vector of a CPU.
const uint THREADS = 8;
layout(local_size_x = THREADS) in;
// Keys of a thread.
layout(constant_id = 0) const uint RUN = 128;
layout(constant_id = 1) const bool HAS_VALUES = true;

#include "engine/primitives/digits.glsl"

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) readonly buffer Table { uint table[]; };
layout(binding = 2, std430) readonly buffer Totals { uint totals[]; };
layout(binding = 3, std430) readonly buffer Keys { uint keys[]; };
layout(binding = 4, std430) readonly buffer Values { uint values[]; };
layout(binding = 5, std430) writeonly buffer SortedKeys { uint sorted_keys[]; };
layout(binding = 6, std430) writeonly buffer SortedValues { uint sorted_values[]; };

#include "engine/primitives/count.glsl"

// How many keys of each digit a thread has; then where its next one goes.
shared uint places[THREADS * DIGITS];
shared uint sums[THREADS];

void main() {
    uint thread = gl_LocalInvocationIndex, tile = group_index(), available = element_count();
    if (tile * THREADS * RUN >= available) return;
    uint first = (tile * THREADS + thread) * RUN, end = min(first + RUN, available), own = thread * DIGITS;
    for (uint d = 0; d <= mask; ++d) places[own + d] = 0;
    for (uint at = first; at < end; ++at) places[own + digit(keys[at])] += 1;

    // Places of the first key of each digit, a share of the digits to a thread: after all keys of lower digits, after those of this
    // digit in the tiles before, after those of the threads before.
    const uint share = DIGITS / THREADS;
    uint sum = 0;
    for (uint d = thread * share; d < (thread + 1) * share && d <= mask; ++d) sum += totals[d];
    sums[thread] = sum;
    barrier();
    uint before = 0;
    for (uint other = 0; other < thread; ++other) before += sums[other];
    for (uint d = thread * share; d < (thread + 1) * share && d <= mask; ++d) {
        uint place = before + table[d * stride + tile];
        for (uint other = d; other < THREADS * DIGITS; other += DIGITS) {
            uint here = places[other];
            places[other] = place;
            place += here;
        }
        before += totals[d];
    }
    barrier();
    for (uint at = first; at < end; ++at) {
        uint key = keys[at], slot = own + digit(key), place = places[slot];
        places[slot] = place + 1;
        sorted_keys[place] = key;
        if (HAS_VALUES) sorted_values[place] = values[at];
    }
}
