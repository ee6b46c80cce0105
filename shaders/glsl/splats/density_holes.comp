#version 450
#extension GL_GOOGLE_include_directive : require
// Densification, 2: the free slots, in order.
#include "shared/group.glsl"
#include "splats/density.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer Holes { uint holes[]; };
layout(binding = 1, std430) readonly buffer HoleRanks { uint hole_ranks[]; };
layout(binding = 2, std430) readonly buffer Totals { uint totals[]; };
layout(binding = 3, std430) writeonly buffer Slots { uint slots[]; };

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i < totals[2] && holes[i] != 0) slots[hole_ranks[i]] = i;
}
