#version 450
#extension GL_GOOGLE_include_directive : require
// Binned pass, 4 of 8: an instance for each tile that a pair's kernel reaches into, in the order of depth.
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
layout(binding = 8, std430) readonly buffer TileOffsets { uint tile_offsets[]; };
layout(binding = 9, std430) writeonly buffer TileKeys { uint tile_keys[]; };
layout(binding = 10, std430) writeonly buffer TileInstances { uint tile_instances[]; };
layout(binding = 11, std430) writeonly buffer InstanceSlots { uint instance_slots[]; };
// First instance and number of instances of each slot.
layout(binding = 12, std430) writeonly buffer Runs { uvec2 runs[]; };
layout(binding = 13, std430) readonly buffer PaperBlock { PaperSettings paper[]; };
layout(binding = 14, std430) readonly buffer ScaleBlock { Scale scale_state[]; };

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    uint rank = group_index() * 64 + gl_LocalInvocationIndex;
    uint count = min(counts[0], p.capacity);
    if (control[0].halt != 0 || rank >= count) return;
    uint slot = depth_slots[rank], pair = pairs[slot], probe = pair / s.splats;
    uint index = (control[0].iteration * p.probes + probe) % p.pool;
    Disc disc = disc_of(splats[pair % s.splats].centre, probes[index].position, scale_state[0].log_scale);
    uint first = tile_offsets[rank], instance = first;
    // Room for as many as were counted: of that all is filled and nothing behind it, whatever is found here.
    uint end = min(rank + 1 < count ? tile_offsets[rank + 1] : counts[1], p.instances);
    for (uint tile = 0; tile < TILES; ++tile) {
        bool left_over = end - min(end, instance) >= TILES - tile;
        if (instance < end && (left_over || reaches(disc, cones[tile]))) {
            tile_keys[instance] = probe * TILES + tile;
            tile_instances[instance] = instance;
            instance_slots[instance] = slot;
            ++instance;
        }
    }
    runs[slot] = uvec2(first, instance - min(first, instance));
}
