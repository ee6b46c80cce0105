#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Fisher information, 4: from what a view's pixels answer to each Gaussian to the diagonal of its information about the
// parameters; what that is worth beside what is known, or, where LEARN, what is known with it.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/harmonics.glsl"
#include "splats/fisher.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint stride;
    uint view;
    // Degree of the harmonics.
    uint degree;
    // Whether to add to what is known.
    uint learn;
    // Added to what is known.
    float lambda;
    // Which sum over parameters a view is worth.
    uint criterion;
};

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) readonly buffer Parameters { float parameters[]; };
layout(binding = 3, std430) readonly buffer Squares { float squares[]; };
// Planes as the parameters'.
layout(binding = 4, std430) restrict buffer Known { float known[]; };
// What the view is worth for each Gaussian.
layout(binding = 5, std430) writeonly buffer Scores { float scores[]; };

const uint RATIO = 0;  // of what the view adds over what is known (FisherRF)
const uint DETERMINANT = 1;  // the rise of its logarithm, of a diagonal matrix (D-optimality)
const uint TRACE = 2;  // its rise (T-optimality)

float worth(uint plane, uint i, float information) {
    uint at = plane * stride + i;
    if (learn != 0) {
        known[at] += information;
        return 0.0;
    }
    if (criterion == TRACE) return information;
    float ratio = information / (known[at] + lambda);
    if (criterion != DETERMINANT) return ratio;
    // The series where the logarithm of a number near one would lose what counts.
    return ratio < 0.01 ? ratio * (1.0 - ratio * (0.5 - ratio / 3.0)) : log(1.0 + ratio);
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= population[0]) return;
    float of_weight = squares[i];
    if (of_weight == 0.0) {
        scores[i] = 0.0;
        return;
    }
    float clear = 1.0 - sigmoid(parameters[OPACITY * stride + i]);
    float score = worth(OPACITY, i, clear * clear * squares[stride + i]);
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        score += worth(LOG_SCALE + c, i, squares[(2 + c) * stride + i]);
        score += worth(CENTRE + c, i, squares[(5 + c) * stride + i]);
    }
    vec3 centre = vec3(parameters[i], parameters[stride + i], parameters[2 * stride + i]);
    float basis[16];
    harmonics(normalize(centre - views[view].position), basis);
    uint terms = (degree + 1) * (degree + 1), lit = uint(squares[SQUARES * stride + i]);
    [[unroll]] for (uint k = 0; k < 16; ++k) {
        if (k >= terms) break;
        [[unroll]] for (uint c = 0; c < 3; ++c) {
            if ((lit >> c & 1) != 0) score += worth(HARMONICS + 3 * k + c, i, basis[k] * basis[k] * of_weight);
        }
    }
    scores[i] = score;
}
