#version 450
#extension GL_GOOGLE_include_directive : require
// Relocation, 2: every dead or new Gaussian draws one that lives, by opacity, and is counted there. Counts are whole numbers:
// the order of counting cannot show.
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "splats/gaussian.glsl"
#include "splats/mcmc.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer Weights { uint weights[]; };
// Sum of the weights before each, and of all.
layout(binding = 1, std430) readonly buffer Cumulative { uint cumulative[]; };
layout(binding = 2, std430) readonly buffer Total { uint total[]; };
layout(binding = 3, std430) buffer Picks { uint picks[]; };
layout(binding = 4, std430) writeonly buffer Sources { uint sources[]; };

const uint PICK_STREAM = 0x48000000u;

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i >= after) return;
    if (i < before && weights[i] != 0) {
        sources[i] = NONE;
        return;
    }
    if (total[0] == 0) {
        // No live Gaussian: nothing moves, and new ones are dead like the rest.
        sources[i] = i < before ? NONE : 0;
        return;
    }
    uint word = pcg4d(uvec4(seed, PICK_STREAM + iteration, i)).x, high, low;
    umulExtended(word, total[0], high, low);
    // The last Gaussian with no more than `high` before it.
    uint from = 0, to = before;
    while (to - from > 1) {
        uint middle = (from + to) / 2;
        if (cumulative[middle] <= high) from = middle;
        else to = middle;
    }
    sources[i] = from;
    atomicAdd(picks[from], 1);
}
