#version 450
#extension GL_GOOGLE_include_directive : require
// Binned pass, 8 of 8: a workgroup per probe sums its tiles and its splats, as the dense pass does at its end.
#include "shared/fold.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
#include "planner/plan/paper/bin.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 8, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 2, std430) readonly buffer TileSums { vec4 tile_sums[]; };
layout(binding = 3, std430) readonly buffer Slots { uint slots[]; };
layout(binding = 4, std430) readonly buffer Partials { Gradient partials[]; };
layout(binding = 5, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 6, std430) writeonly buffer Tallies { Tally tallies[]; };
// Host-visible: [3] pairs, [4] instances that an iteration needed at most.
layout(binding = 7, std430) buffer Mailbox { uint mailbox[]; };
layout(binding = 9, std430) readonly buffer PaperBlock { PaperSettings paper[]; };

shared vec4 sums[256];

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    if (control[0].halt != 0) return;
    uint probe = gl_WorkGroupID.x, thread = gl_LocalInvocationIndex;
    // Host memory is slow to read: requested first, needed last.
    uvec2 most = probe == 0 && thread == 0 ? uvec2(mailbox[3], mailbox[4]) : uvec2(0);
    vec4 sum = vec4(0.0);
    for (uint tile = thread; tile < TILES; tile += 256) sum.xyz += tile_sums[probe * TILES + tile].xyz;
    for (uint j = thread; j < s.splats; j += 256) {
        uint slot = slots[probe * s.splats + j];
        if (slot != NONE) sum.w += partials[slot].own;
    }
    sums[thread] = sum;
    FOLD(thread, 256, sums[thread] += sums[thread + apart]);
    if (thread != 0) return;
    sum = sums[0];
    uint index = (control[0].iteration * p.probes + probe) % p.pool;
    tallies[probe] = Tally(sum.x * texel_weight(probes[index], p), sum.w, sum.y, sum.z, 0);
    if (probe == 0) {
        mailbox[3] = max(most.x, counts[0]);
        mailbox[4] = max(most.y, counts[1]);
    }
}
