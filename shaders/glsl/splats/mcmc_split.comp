#version 450
#extension GL_GOOGLE_include_directive : require
// Relocation, 3: a Gaussian that represents n from now on gets the opacity and the size with which n of it look as it did.
// Its moments stay, so that it and its copies, which have none, do not move in step for ever.
// Twin: `split` in src/splats/twin/optimise.rs, without the bounds of opacity and powers. With o the new opacity, the sum over the
// powers of o in eq. 9 of the paper is sum_j C(n, j) (-1)^(j-1) o^j / sqrt(j).
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/mcmc.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Control { uint control[]; };
layout(binding = 1, std430) readonly buffer Picks { uint picks[]; };
layout(binding = 2, std430) buffer Parameters { float parameters[]; };

// Powers past this one are too small to count.
const uint MAX_POWERS = 64;

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (control[0] != 0 || i >= before || picks[i] == 0) return;
    float n = float(picks[i] + 1);
    float opacity = min(sigmoid(parameters[OPACITY * stride + i]), 0.9999);
    // 1 - (1 - opacity)^(1/n), where it is small without the difference of two numbers near 1.
    float x = -log(1.0 - opacity) / n, part = x < 1e-2 ? x * (1.0 - 0.5 * x) : 1.0 - exp(-x), term = -1.0, sum = 0.0;
    for (uint j = 1; j <= min(picks[i] + 1, MAX_POWERS); ++j) {
        term *= -(n - float(j) + 1.0) / float(j) * part;
        sum += term / sqrt(float(j));
    }
    part = clamp(part, least, 0.9999);
    parameters[OPACITY * stride + i] = log(part / (1.0 - part));
    float shrink = log(opacity / sum);
    for (uint c = 0; c < 3; ++c) parameters[(LOG_SCALE + c) * stride + i] += shrink;
}
