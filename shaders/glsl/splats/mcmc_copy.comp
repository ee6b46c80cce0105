#version 450
#extension GL_GOOGLE_include_directive : require
// Relocation, 4: dead and new Gaussians become what they drew.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/mcmc.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Control { uint control[]; };
layout(binding = 1, std430) readonly buffer Sources { uint sources[]; };
layout(binding = 2, std430) buffer Parameters { float parameters[]; };
layout(binding = 3, std430) writeonly buffer First { float first[]; };
layout(binding = 4, std430) writeonly buffer Second { float second[]; };
layout(binding = 5, std430) writeonly buffer Population { uint population[]; };

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (control[0] != 0 || i >= after) return;
    if (i == 0) population[0] = after;
    uint source = sources[i];
    if (source == NONE) return;
    for (uint plane = 0; plane < planes; ++plane) {
        parameters[plane * stride + i] = parameters[plane * stride + source];
        first[plane * stride + i] = 0.0;
        second[plane * stride + i] = 0.0;
    }
}
