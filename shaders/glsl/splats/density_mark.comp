#version 450
#extension GL_GOOGLE_include_directive : require
// Densification, 1: which Gaussians have a child, and which slots are free or become so.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/density.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Population { uint population[]; };
layout(binding = 1, std430) readonly buffer Parameters { float parameters[]; };
layout(binding = 2, std430) readonly buffer Statistics { vec2 statistics[]; };
layout(binding = 3, std430) writeonly buffer Children { uint children[]; };
layout(binding = 4, std430) writeonly buffer Holes { uint holes[]; };
// [2] Gaussians and free slots before.
layout(binding = 5, std430) writeonly buffer Totals { uint totals[]; };

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i == 0) totals[2] = population[0];
    if (i >= population[0]) return;
    float logit = parameters[OPACITY * stride + i], widest = parameters[LOG_SCALE * stride + i];
    for (uint c = 1; c < 3; ++c) widest = max(widest, parameters[(LOG_SCALE + c) * stride + i]);
    vec2 seen = statistics[i];
    bool grows = seen.y > 0.0 && seen.x > coarse * seen.y;
    // What is split becomes smaller first.
    float width = exp(widest) / (grows && exp(widest) > wide ? 1.6 : 1.0);
    bool hole = is_free(logit) || sigmoid(logit) < least || width > too_wide;
    children[i] = grows && !hole ? 1 : 0;
    holes[i] = hole ? 1 : 0;
}
