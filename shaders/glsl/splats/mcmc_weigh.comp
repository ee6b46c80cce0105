#version 450
#extension GL_GOOGLE_include_directive : require
// Relocation, 1: how likely each Gaussian is to be drawn: its opacity, in whole steps; dead ones are not drawn.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/mcmc.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer Parameters { float parameters[]; };
layout(binding = 1, std430) writeonly buffer Weights { uint weights[]; };
layout(binding = 2, std430) writeonly buffer Picks { uint picks[]; };

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i >= before) return;
    float opacity = sigmoid(parameters[OPACITY * stride + i]);
    weights[i] = opacity > least ? max(uint(opacity * float(steps)), 1u) : 0;
    picks[i] = 0;
}
