#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Poses, 1: sums over 1024 Gaussians of what turning the world about the camera, and moving it, change in the loss. In fixed order.
#include "shared/fold.glsl"
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/pose.glsl"
layout(local_size_x = 256) in;

layout(push_constant) uniform Push {
    // From one plane of forces to the next: the most Gaussians there can be.
    uint stride;
};
layout(binding = 0, std430) readonly buffer Population { uint population[]; };
// Of each Gaussian, in planes: its torque about the camera, and its force.
layout(binding = 1, std430) readonly buffer Forces { float forces[]; };
layout(binding = 2, std430) writeonly buffer Sums { float pose_sums[]; };

shared float sums[LEARNT][256];

void main() {
    uint thread = gl_LocalInvocationIndex, begin = group_index() * PER_GROUP, end = min(begin + PER_GROUP, population[0]);
    if (begin >= end) return;
    [[unroll]] for (uint k = 0; k < LEARNT; ++k) {
        float sum = 0.0;
        for (uint i = begin + thread; i < end; i += 256) sum += forces[k * stride + i];
        sums[k][thread] = sum;
    }
    FOLD(thread, 256, [[unroll]] for (uint k = 0; k < LEARNT; ++k) sums[k][thread] += sums[k][thread + apart]);
    barrier();
    if (thread < LEARNT) pose_sums[LEARNT * group_index() + thread] = sums[thread][0];
}
