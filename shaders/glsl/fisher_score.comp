#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Fisher information, 3: every Gaussian sums the squares of its instances, in order, to the diagonal of a view's information
// about its parameters; what that is worth beside what is known, or, where LEARN, what is known with it.
#include "shared/group.glsl"
#include "shared/gaussian.glsl"
#include "shared/harmonics.glsl"
#include "shared/fisher.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint stride;
    uint view;
    // Degree of the harmonics.
    uint degree;
    // Room for instances: where there were more, nothing is learnt.
    uint room;
    // Added to what is known.
    float lambda;
    // Whether to add to what is known.
    uint learn;
};

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 3, std430) readonly buffer Parameters { float parameters[]; };
layout(binding = 4, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 5, std430) readonly buffer Runs { uvec2 runs[]; };
layout(binding = 6, std430) readonly buffer Partials { float partials[]; };
// Planes as the parameters'.
layout(binding = 7, std430) restrict buffer Known { float known[]; };
// What the view is worth for each Gaussian.
layout(binding = 8, std430) writeonly buffer Scores { float scores[]; };

float worth(uint plane, uint i, float information) {
    uint at = plane * stride + i;
    if (learn != 0) known[at] += information;
    return learn != 0 ? 0.0 : information / (known[at] + lambda);
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= population[0] || counts[0] > room) return;
    Projected splat = projected[i];
    uvec2 run = splat.opacity > 0.0 ? runs[i] : uvec2(0);
    if (run.y == 0) {
        scores[i] = 0.0;
        return;
    }
    float sum[SQUARES];
    [[unroll]] for (uint v = 0; v < SQUARES; ++v) sum[v] = 0.0;
    for (uint k = run.x; k < run.x + run.y; ++k) {
        [[unroll]] for (uint v = 0; v < SQUARES; ++v) sum[v] += partials[SQUARES * k + v];
    }
    float clear = 1.0 - sigmoid(parameters[OPACITY * stride + i]), score = worth(OPACITY, i, clear * clear * sum[1]);
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        score += worth(LOG_SCALE + c, i, sum[2 + c]);
        score += worth(CENTRE + c, i, sum[5 + c]);
    }
    vec3 centre = vec3(parameters[i], parameters[stride + i], parameters[2 * stride + i]);
    float basis[16];
    harmonics(normalize(centre - views[view].position), basis);
    uint terms = (degree + 1) * (degree + 1);
    [[unroll]] for (uint k = 0; k < 16; ++k) {
        if (k >= terms) break;
        [[unroll]] for (uint c = 0; c < 3; ++c) {
            if (splat.colour[c] > 0.0) score += worth(HARMONICS + 3 * k + c, i, basis[k] * basis[k] * sum[0]);
        }
    }
    scores[i] = score;
}
