#version 450
#extension GL_GOOGLE_include_directive : require
// Manifold sampling (Lyu et al. 2024), 1: every parameter of a model moved by its noise, or as it is where the amplitude is 0.
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "splats/noise.glsl"
layout(local_size_x = 256) in;

layout(push_constant) uniform Push {
    // Values: planes times Gaussians.
    uint count;
    // Which of each parameter's draws.
    uint draw;
    uvec2 seed;
    // What the noise is multiplied by.
    float amplitude;
};

layout(binding = 0, std430) readonly buffer Base { float base[]; };
layout(binding = 1, std430) readonly buffer Scales { float scales[]; };
layout(binding = 2, std430) writeonly buffer Parameters { float parameters[]; };

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i < count) parameters[i] = base[i] + amplitude * scales[i] * perturbation(seed, i, draw);
}
