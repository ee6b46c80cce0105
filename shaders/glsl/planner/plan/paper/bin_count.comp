#version 450
#extension GL_GOOGLE_include_directive : require
// Binned pass, 3 of 8: in the order of depth, how many tiles does each pair's kernel reach into?
#include "shared/group.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
#include "planner/plan/paper/bin.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 4, std430) readonly buffer Cones { vec4 cones[]; };
layout(binding = 5, std430) readonly buffer Pairs { uint pairs[]; };
layout(binding = 6, std430) readonly buffer DepthSlots { uint depth_slots[]; };
layout(binding = 7, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 8, std430) writeonly buffer TileCounts { uint tile_counts[]; };
layout(binding = 9, std430) readonly buffer PaperBlock { PaperSettings paper[]; };
layout(binding = 10, std430) readonly buffer ScaleBlock { Scale scale_state[]; };

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    uint rank = group_index() * 64 + gl_LocalInvocationIndex;
    if (control[0].halt != 0 || rank >= min(counts[0], p.capacity)) return;
    uint pair = pairs[depth_slots[rank]];
    uint index = (control[0].iteration * p.probes + pair / s.splats) % p.pool;
    Disc disc = disc_of(splats[pair % s.splats].centre, probes[index].position, scale_state[0].log_scale);
    uint found = 0;
    for (uint tile = 0; tile < TILES; ++tile) {
        if (reaches(disc, cones[tile])) ++found;
    }
    tile_counts[rank] = found;
}
