#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// COVER: how much of what a view shows of each Gaussian has been seen from near the same direction; or, where LEARN, from where
// it has been seen now.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/sums.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint stride;
    uint view;
    // Capacity for instances: where there were more, nothing is learnt.
    uint capacity;
    // Whether to remember the directions.
    uint learn;
};

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 3, std430) readonly buffer Parameters { float parameters[]; };
layout(binding = 4, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 5, std430) readonly buffer Runs { uvec2 runs[]; };
// Sums over pixels of each instance, of which the first is that of its parts in them: the gradient of red by its own red.
layout(binding = 6, std430) readonly buffer Partials { float partials[]; };
// Unit vectors of the bins.
layout(binding = 7, std430) readonly buffer Bins { vec4 bins[]; };
// Bins that each Gaussian has been seen from, a bit each.
layout(binding = 8, std430) restrict buffer Seen { uvec2 seen[]; };
// Part of each Gaussian in the picture, and the same times its coverage.
layout(binding = 9, std430) writeonly buffer Parts { float parts[]; };
layout(binding = 10, std430) writeonly buffer Covered { float covered[]; };

const uint BINS = 64;

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= population[0] || counts[0] > capacity) return;
    uvec2 run = projected[i].opacity > 0.0 ? runs[i] : uvec2(0);
    float part = 0.0;
    // By fours: a Gaussian before the camera has as many instances as the picture has tiles, and some devices bound loops.
    for (uint k = 0; k < run.y; k += 4) {
        [[unroll]] for (uint j = 0; j < 4; ++j) part += k + j < run.y ? partials[SUMS * (run.x + k + j)] : 0.0;
    }
    vec3 centre = vec3(parameters[i], parameters[stride + i], parameters[2 * stride + i]);
    vec3 direction = normalize(views[view].position - centre);
    uvec2 before = seen[i];
    float nearest = -1.0, best = -2.0;
    uint bin = 0;
    for (uint b = 0; b < BINS; ++b) {
        float cosine = dot(direction, bins[b].xyz);
        if (cosine > best) {
            best = cosine;
            bin = b;
        }
        if (((b < 32 ? before.x : before.y) >> (b & 31) & 1) != 0) nearest = max(nearest, cosine);
    }
    if (learn != 0 && part > 0.0) {
        seen[i] = before | (bin < 32 ? uvec2(1u << bin, 0) : uvec2(0, 1u << (bin - 32)));
    }
    parts[i] = part;
    covered[i] = part * 0.5 * (1.0 + nearest);
}
