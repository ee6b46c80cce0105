#version 450
#extension GL_GOOGLE_include_directive : require
// Binned pass, 2 of 8: the pairs that passed take their slots, in the order of the scan; what is sorted next is their
// distance (its bits sort as the number does) with the slot.
#include "shared/group.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 4, std430) readonly buffer Flags { uint flags[]; };
layout(binding = 5, std430) readonly buffer Offsets { uint offsets[]; };
layout(binding = 6, std430) writeonly buffer Slots { uint slots[]; };
layout(binding = 7, std430) writeonly buffer Pairs { uint pairs[]; };
layout(binding = 8, std430) writeonly buffer DepthKeys { uint depth_keys[]; };
layout(binding = 9, std430) writeonly buffer DepthSlots { uint depth_slots[]; };
layout(binding = 10, std430) readonly buffer PaperBlock { PaperSettings paper[]; };

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    uint pair = group_index() * 256 + gl_LocalInvocationIndex;
    if (control[0].halt != 0 || pair >= p.probes * s.splats) return;
    uint slot = offsets[pair];
    bool kept = flags[pair] != 0 && slot < p.capacity;
    slots[pair] = kept ? slot : NONE;
    if (!kept) return;
    uint index = (control[0].iteration * p.probes + pair / s.splats) % p.pool;
    pairs[slot] = pair;
    depth_keys[slot] = floatBitsToUint(length(splats[pair % s.splats].centre - probes[index].position));
    depth_slots[slot] = slot;
}
