#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Fisher information, 3: every Gaussian sums the squares of its instances, in order.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/fisher.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Population { uint population[]; };
layout(binding = 1, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 2, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 3, std430) readonly buffer Runs { uvec2 runs[]; };
layout(binding = 4, std430) readonly buffer Partials { float partials[]; };
// SQUARES planes, and one of what of the colour is not cut off at black: a bit for each of red, green and blue.
layout(binding = 5, std430) writeonly buffer Squares { float squares[]; };

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= population[0] || counts[0] > capacity) return;
    Projected splat = projected[i];
    uvec2 run = splat.opacity > 0.0 ? runs[i] : uvec2(0);
    float sum[SQUARES];
    [[unroll]] for (uint v = 0; v < SQUARES; ++v) sum[v] = 0.0;
    // By fours: a Gaussian before the camera has as many instances as the picture has tiles, and some devices bound loops.
    for (uint k = 0; k < run.y; k += 4) {
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            if (k + j >= run.y) continue;
            [[unroll]] for (uint v = 0; v < SQUARES; ++v) sum[v] += partials[SQUARES * (run.x + k + j) + v];
        }
    }
    [[unroll]] for (uint v = 0; v < SQUARES; ++v) squares[v * stride + i] = sum[v];
    squares[SQUARES * stride + i] = dot(vec3(greaterThan(splat.colour, vec3(0.0))), vec3(1.0, 2.0, 4.0));
}
