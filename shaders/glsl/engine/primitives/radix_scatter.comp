// Moves each key of a tile (and its value) to its place in the order of one digit; equal digits keep their order.
//
// Ranking. A subgroup takes consecutive keys, row after row. In a row, ballots over the digit's bits find the keys with the same
// digit: those before it are its rank in the row, and the subgroup's own histogram holds the rows before. Nothing but the order
// of the keys enters a rank, so the result does not depend on how wide a subgroup is.
//
// Writing. Keys go to shared memory in their order within the tile and from there to the output, so that neighbouring
// threads write neighbouring addresses; values follow the same way.
//
// Bytes per pair and pass: histogram reads 4, this reads 8 and writes 8; the table adds 256 * 16 bytes per tile, 1 byte
// per key. No workgroup waits for another.
#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "shared/group.glsl"

// At most 16 subgroups.
layout(local_size_x = 256, local_size_x_id = 0) in;
layout(constant_id = 1) const bool HAS_VALUES = true;

#include "engine/primitives/radix.glsl"

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) readonly buffer Table { uint table[]; };
layout(binding = 2, std430) readonly buffer Totals { uint totals[]; };
layout(binding = 3, std430) readonly buffer Keys { uint keys[]; };
layout(binding = 4, std430) readonly buffer Values { uint values[]; };
layout(binding = 5, std430) writeonly buffer SortedKeys { uint sorted_keys[]; };
layout(binding = 6, std430) writeonly buffer SortedValues { uint sorted_values[]; };

#include "engine/primitives/count.glsl"
#define LINE uvec2
#include "engine/primitives/line_scan.glsl"

// First the subgroups' histograms, at most 16; then the tile in order, at most 4096 words.
shared uint pool[16 * DIGITS];
// What takes a key's place in the tile to its place in the output, by digit.
shared uint displacement[DIGITS];

// Those of the threads `peers` whose digit is the same.
uvec4 peers_of(uint own, uvec4 peers) {
    [[unroll]] for (uint bit = 0; bit < 8; bit++) {
        uint set = (own >> bit) & 1;
        peers &= subgroupBallot(set == 1) ^ uvec4(set - 1);
    }
    return peers;
}

void main() {
    uint available = element_count();
    uint tile = group_index();
    if (tile * TILE >= available) {
        return;
    }
    // The only use of the subgroup's width. Drivers may run narrower ones than they report; the number of subgroups in the
    // workgroup is reliable.
    uint width = gl_WorkGroupSize.x / gl_NumSubgroups;
    uint lane = gl_SubgroupInvocationID;
    uint thread = gl_SubgroupID * width + lane;
    uint own_histogram = gl_SubgroupID * DIGITS;
    uint first = tile * TILE + gl_SubgroupID * width * ITEMS + lane;

    for (uint i = thread; i < gl_NumSubgroups * DIGITS; i += gl_WorkGroupSize.x) {
        pool[i] = 0;
    }
    for (uint d = thread; d < DIGITS; d += gl_WorkGroupSize.x) {
        displacement[d] = d <= mask ? table[d * stride + tile] : 0;
    }
    // Past the end, keys of the highest digit: they come last in the tile and are never written.
    uint held[ITEMS];
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint at = first + i * width;
        held[i] = at < available ? keys[at] : 0xffffffffu;
    }
    barrier();

    uvec4 everyone = subgroupBallot(true);
    uint place[ITEMS];
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint slot = own_histogram + digit(held[i]);
        uvec4 peers = peers_of(digit(held[i]), everyone);
        uint rank = subgroupBallotExclusiveBitCount(peers);
        uint before = pool[slot];
        subgroupBarrier();
        if (rank == 0) {
            pool[slot] = before + subgroupBallotBitCount(peers);
        }
        subgroupBarrier();
        place[i] = before + rank;
    }
    barrier();

    // Histograms become places in the tile: x runs over this tile's digits, y over all tiles' digits.
    uint share = DIGITS / gl_WorkGroupSize.x;
    uvec2 sum = uvec2(0);
    for (uint d = thread * share; d < (thread + 1) * share; d++) {
        for (uint i = d; i < gl_NumSubgroups * DIGITS; i += DIGITS) {
            sum.x += pool[i];
        }
        sum.y += d <= mask ? totals[d] : 0;
    }
    uvec2 all;
    uvec2 before = line_scan(thread, sum, all);
    for (uint d = thread * share; d < (thread + 1) * share; d++) {
        displacement[d] += before.y - before.x;
        for (uint i = d; i < gl_NumSubgroups * DIGITS; i += DIGITS) {
            uint here = pool[i];
            pool[i] = before.x;
            before.x += here;
        }
        before.y += d <= mask ? totals[d] : 0;
    }
    barrier();

    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        place[i] += pool[own_histogram + digit(held[i])];
    }
    barrier();
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        pool[place[i]] = held[i];
    }
    barrier();
    uint in_tile = min(TILE, available - tile * TILE);
    uint target[ITEMS];
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint at = i * gl_WorkGroupSize.x + thread;
        uint key = pool[at];
        target[i] = at + displacement[digit(key)];
        if (at < in_tile) {
            sorted_keys[target[i]] = key;
        }
    }
    if (!HAS_VALUES) {
        return;
    }
    barrier();
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint at = first + i * width;
        pool[place[i]] = at < available ? values[at] : 0;
    }
    barrier();
    [[unroll]] for (uint i = 0; i < ITEMS; i++) {
        uint at = i * gl_WorkGroupSize.x + thread;
        if (at < in_tile) {
            sorted_values[target[i]] = pool[at];
        }
    }
}
