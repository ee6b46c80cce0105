// Moves each key of a tile (and its value) to its place in the order of one digit, in one reading of the keys; equal digits keep their
// order. Adinets and Merrill, "Onesweep: A Faster Least Significant Digit Radix Sort for GPUs", 2022.
//
// Before a tile. A workgroup takes the next tile, counts its digits and publishes the counts. The last tile of a group publishes the
// group's sum, and then that of all up to it; so a tile adds up the tiles before it in its group, and the groups before, from the last one
// back to one that knows the sum of all. Without groups each tile would read the counts of many others. A workgroup may wait for tiles
// that others have taken, so those must run on meanwhile: only devices on which they do get this shader. Sums are of integers, the same
// whoever waits for whom.
//
// Ranking. A subgroup takes consecutive keys, row after row. The counts of the subgroups before it say where in the tile its keys of a
// digit begin. In a row, ballots over the digit's bits find the keys with the same digit: those before it are its rank in the row. Nothing
// but the order of the keys enters a place, so the result does not depend on how wide a subgroup is.
//
// Writing. Keys go to shared memory in their order within the tile and from there to the output, so that neighbouring threads write
// neighbouring addresses; values follow the same way.
//
// Bytes per pair and pass: reads 8 and writes 8; `states` adds less than one.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_memory_scope_semantics : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_arithmetic : require

layout(local_size_x = 256, local_size_x_id = 0) in;
layout(constant_id = 2) const bool HAS_VALUES = true;
// The most in a workgroup; each has at most 32 threads.
layout(constant_id = 3) const uint SUBGROUPS = 16;

#include "engine/primitives/sweep.glsl"

layout(push_constant) uniform Push {
    uint count;
    uint count_index;
    // Lowest bit of the digit, and a mask as wide as the digit (at most 8 bits).
    uint shift;
    uint mask;
    // Number of the pass.
    uint pass;
    // Where in `states` those of this pass begin, and those of the next, which this one empties.
    uint own_states;
    uint next_states;
    // A line of `states` has one for each digit. The first is of what comes before all tiles; then come those of the groups, and behind
    // these `groups` lines those of the tiles.
    uint groups;
};

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) buffer Header { uint header[]; };
layout(binding = 2, std430) buffer States { uint states[]; };
layout(binding = 3, std430) readonly buffer Keys { uint keys[]; };
layout(binding = 4, std430) readonly buffer Values { uint values[]; };
layout(binding = 5, std430) writeonly buffer SortedKeys { uint sorted_keys[]; };
layout(binding = 6, std430) writeonly buffer SortedValues { uint sorted_values[]; };

#include "engine/primitives/count.glsl"

// A state: a number below 2^30, and in the two highest bits what it counts: nothing yet (0), the keys of a digit in the tile or group, or
// those of all tiles up to it and of all lower digits.
const uint NUMBER = 0x3fffffff;
const uint OWN = 0x40000000;
const uint UP_TO = 0x80000000;

// First the subgroups' counts; then the tile in order.
const uint COUNTS = SUBGROUPS * DIGITS;
shared uint pool[COUNTS > TILE ? COUNTS : TILE];
// Keys of each digit in the tile.
shared uint tally[DIGITS];
// What takes a key's place in the tile to its place in the output, by digit.
shared uint displacement[DIGITS];
shared uvec2 sums[SUBGROUPS];
shared uint taken;
// `shift`, unknown to the compiler: else it keeps all digits in registers from the counting to the ranking, and fewer workgroups fit.
shared uint shift_again;

// Consecutive digits that a thread looks after; threads past the last digit have none.
const uint SHARE = (DIGITS + gl_WorkGroupSize.x - 1) / gl_WorkGroupSize.x;

uint digit(uint key) {
    return (key >> shift) & mask;
}

void publish(uint line, uint d, uint state) {
    atomicStore(states[own_states + line * DIGITS + d], state, gl_ScopeDevice, gl_StorageSemanticsNone, gl_SemanticsRelaxed);
}

uint state_of(uint line, uint d) {
    return atomicLoad(states[own_states + line * DIGITS + d], gl_ScopeDevice, gl_StorageSemanticsNone, gl_SemanticsRelaxed);
}

// Groups whose states are read at once: that takes hardly longer than one.
const uint WINDOW = 2;

// Adds to `displacement` what lies before the tile, for the digits from `begin` to `end`.
void look_back(uint tile, uint begin, uint end) {
    uint group = tile / GROUP;
    uint inside = tile % GROUP;
    uint first_line = groups + tile - inside;
    bool last = inside == GROUP - 1;
    for (uint d = begin; d < end; d++) {
        uint near[GROUP - 1];
        uint far[WINDOW];
        uint line = group;
        [[unroll]] for (uint i = 0; i < GROUP - 1; i++) {
            near[i] = i < inside ? state_of(first_line + i, d) : OWN;
        }
        [[unroll]] for (uint back = 0; back < WINDOW; back++) {
            far[back] = state_of(max(line, back) - back, d);
        }
        uint sum = 0;
        [[unroll]] for (uint i = 0; i < GROUP - 1; i++) {
            while (near[i] == 0) {
                near[i] = state_of(first_line + i, d);
            }
            sum += near[i] & NUMBER;
        }
        if (last) {
            publish(group + 1, d, OWN | (sum + tally[d]));
        }
        // The first line always ends this.
        bool found = false;
        while (!found) {
            [[unroll]] for (uint back = 0; back < WINDOW; back++) {
                if (!found) {
                    while (far[back] == 0) {
                        far[back] = state_of(line - back, d);
                    }
                    sum += far[back] & NUMBER;
                    found = far[back] >= UP_TO;
                }
            }
            if (!found) {
                line -= WINDOW;
                [[unroll]] for (uint back = 0; back < WINDOW; back++) {
                    far[back] = state_of(max(line, back) - back, d);
                }
            }
        }
        displacement[d] += sum;
        states[next_states + (groups + tile) * DIGITS + d] = 0;
        if (last) {
            publish(group + 1, d, UP_TO | (sum + tally[d]));
            states[next_states + (group + 1) * DIGITS + d] = 0;
        }
    }
}

void main() {
    // The only use of the subgroup's width. Drivers may run narrower ones than they report; the number of subgroups in the
    // workgroup is reliable.
    uint width = gl_WorkGroupSize.x / gl_NumSubgroups;
    uint lane = gl_SubgroupInvocationID;
    uint thread = gl_SubgroupID * width + lane;
    if (thread == 0) {
        taken = atomicAdd(header[pass], 1);
        shift_again = shift;
    }
    for (uint i = thread; i < COUNTS; i += gl_WorkGroupSize.x) {
        pool[i] = 0;
    }
    barrier();
    uint tile = taken;
    uint available = element_count();
    if (tile * TILE >= available) {
        return;
    }

    // Past the end, keys of the highest digit: they come last in the last tile and are never written.
    uint own_counts = gl_SubgroupID * DIGITS;
    uint first = tile * TILE + gl_SubgroupID * width * ITEMS + lane;
    uint left = available - min(first, available);
    uint held[ITEMS];
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        held[i] = i * width < left ? keys[first + i * width] : 0xffffffffu;
    }
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        atomicAdd(pool[own_counts + digit(held[i])], 1);
    }
    barrier();

    // x runs over this tile's keys of lower digits, y over all tiles'; y matters in the first tile only.
    uint begin = min(thread * SHARE, DIGITS);
    uint end = min(begin + SHARE, DIGITS);
    uvec2 sum = uvec2(0);
    for (uint d = begin; d < end; d++) {
        uint here = 0;
        [[unroll]] for (uint i = 0; i < SUBGROUPS; i++) {
            uint own = pool[i * DIGITS + d];
            pool[i * DIGITS + d] = here;
            here += own;
        }
        tally[d] = here;
        publish(groups + tile, d, OWN | here);
        sum.x += here;
        if (tile == 0) {
            sum.y += header[TOTALS + pass * DIGITS + d];
        }
    }
    uvec2 before = subgroupExclusiveAdd(sum);
    if (lane == width - 1) {
        sums[gl_SubgroupID] = before + sum;
    }
    barrier();
    [[unroll]] for (uint i = 0; i < SUBGROUPS - 1; i++) {
        if (i < gl_SubgroupID) {
            before += sums[i];
        }
    }
    for (uint d = begin; d < end; d++) {
        [[unroll]] for (uint i = 0; i < SUBGROUPS; i++) {
            pool[i * DIGITS + d] += before.x;
        }
        displacement[d] = -before.x;
        if (tile == 0) {
            publish(0, d, UP_TO | before.y);
            states[next_states + d] = 0;
            before.y += header[TOTALS + pass * DIGITS + d];
        }
        before.x += tally[d];
    }
    barrier();

    uint place[ITEMS];
    uint again = shift_again;
    uint everyone = subgroupBallot(true).x;
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint own = (held[i] >> again) & mask;
        uint slot = own_counts + own;
        uint peers = everyone;
        [[unroll]] for (uint bit = 0; bit < 8; bit++) {
            bool set = ((own >> bit) & 1) == 1;
            uint those = subgroupBallot(set).x;
            peers &= set ? those : ~those;
        }
        uint rank = bitCount(peers & gl_SubgroupLtMask.x);
        uint next = pool[slot];
        subgroupBarrier();
        if (rank == 0) {
            pool[slot] = next + bitCount(peers);
        }
        subgroupBarrier();
        place[i] = next + rank;
    }
    barrier();
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        pool[place[i]] = held[i];
    }
    // Values are on their way while states are read.
    if (HAS_VALUES) {
        [[unroll]] for (uint i = 0; i < ITEMS; i++) {
            held[i] = i * width < left ? values[first + i * width] : 0;
        }
    }
    look_back(tile, begin, end);
    barrier();

    uint written = available - tile * TILE;
    written -= min(thread, written);
    // Four digits to a word.
    uint digits[(ITEMS + 3) / 4];
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint at = i * gl_WorkGroupSize.x + thread;
        uint key = pool[at];
        uint d = digit(key);
        if (i % 4 == 0) {
            digits[i / 4] = d;
        } else {
            digits[i / 4] |= d << 8 * (i % 4);
        }
        uint target = at + displacement[d];
        if (i * gl_WorkGroupSize.x < written) {
            sorted_keys[target] = key;
        }
    }
    if (!HAS_VALUES) {
        return;
    }
    barrier();
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        pool[place[i]] = held[i];
    }
    barrier();
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint at = i * gl_WorkGroupSize.x + thread;
        uint target = at + displacement[(digits[i / 4] >> 8 * (i % 4)) & 255];
        uint value = pool[at];
        if (i * gl_WorkGroupSize.x < written) {
            sorted_values[target] = value;
        }
    }
}
