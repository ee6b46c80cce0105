#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Poses, 2: Adam's step for the correction of the view's pose, against what moving the world would change: a camera that moves sees the
// world move the other way. Then the mean over all photos is taken from each: a motion that all have in common could as well be the
// scene's. One workgroup; sums in fixed order.
#include "shared/adam.glsl"
#include "shared/fold.glsl"
#include "splats/gaussian.glsl"
#include "splats/pose.glsl"
layout(local_size_x = 256) in;

layout(push_constant) uniform Push {
    uint view;
    // Corrections that the mean is taken of: the first so many.
    uint photos;
    float rate;
};
layout(binding = 0, std430) readonly buffer Population { uint population[]; };
layout(binding = 1, std430) readonly buffer Control { uint control[]; };
layout(binding = 2, std430) readonly buffer Sums { float pose_sums[]; };
layout(binding = 3, std430) coherent buffer Poses { PoseState poses[]; };

shared float sums[LEARNT][256];

void main() {
    if (control[0] != 0) return;
    uint thread = gl_LocalInvocationIndex, groups = (population[0] + PER_GROUP - 1) / PER_GROUP;
    [[unroll]] for (uint k = 0; k < LEARNT; ++k) {
        float sum = 0.0;
        for (uint group = thread; group < groups; group += 256) sum += pose_sums[LEARNT * group + k];
        sums[k][thread] = sum;
    }
    FOLD(thread, 256, [[unroll]] for (uint k = 0; k < LEARNT; ++k) sums[k][thread] += sums[k][thread + apart]);
    barrier();
    // Of a gradient that is no number nothing is learnt; the mean would hand it on to all.
    bool finite = true;
    [[unroll]] for (uint k = 0; k < LEARNT; ++k) finite = finite && (floatBitsToUint(sums[k][0]) & 0x7fffffffu) < 0x7f800000u;
    if (!finite) return;
    if (thread < LEARNT) {
        float first = poses[view].first[thread], second = poses[view].second[thread];
        adam_means(-sums[thread][0], first, second);
        poses[view].first[thread] = first;
        poses[view].second[thread] = second;
        vec2 reciprocals = 1.0 / adam_corrections(uint(poses[view].steps) + 1);
        poses[view].value[thread] -= adam_step(rate, first, second, reciprocals, 1e-15);
    }
    memoryBarrierBuffer();
    barrier();
    if (thread == 0) poses[view].steps += 1.0;
    [[unroll]] for (uint k = 0; k < LEARNT; ++k) {
        float sum = 0.0;
        for (uint photo = thread; photo < photos; photo += 256) sum += poses[photo].value[k];
        sums[k][thread] = sum;
    }
    FOLD(thread, 256, [[unroll]] for (uint k = 0; k < LEARNT; ++k) sums[k][thread] += sums[k][thread + apart]);
    barrier();
    for (uint photo = thread; photo < photos; photo += 256) {
        [[unroll]] for (uint k = 0; k < LEARNT; ++k) poses[photo].value[k] -= sums[k][0] / float(photos);
    }
}
