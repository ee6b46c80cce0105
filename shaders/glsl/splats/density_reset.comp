#version 450
#extension GL_GOOGLE_include_directive : require
// Densification, now and then: no Gaussian stays denser than it can prove again.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/density.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer Control { uint control[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) buffer Parameters { float parameters[]; };
layout(binding = 3, std430) writeonly buffer First { float first[]; };
layout(binding = 4, std430) writeonly buffer Second { float second[]; };

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex, k = OPACITY * stride + i;
    if (control[0] != 0 || i >= population[0]) return;
    float most = 2.0 * least;
    parameters[k] = min(parameters[k], log(most / (1.0 - most)));
    first[k] = 0.0;
    second[k] = 0.0;
}
