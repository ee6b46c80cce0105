#version 450
#extension GL_GOOGLE_include_directive : require
// Distance between two pictures' features at each pixel (Zhang et al. 2018, "The Unreasonable Effectiveness of Deep
// Features as a Perceptual Metric", equation 1): the vectors over channels are brought to length 1, and their squared
// differences summed by the weights that were learnt. A thread per pixel. Twin: src/splats/image_metrics/lpips_distance.rs.
#include "shared/group.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint channels;
    uint pixels;
};

layout(binding = 0, std430) readonly buffer Weights { float weights[]; };
layout(binding = 1, std430) readonly buffer First { float first[]; };
layout(binding = 2, std430) readonly buffer Second { float second[]; };
layout(binding = 3, std430) writeonly buffer Distances { float distances[]; };

// Keeps features that are all zero from being divided by zero.
const float TINY = 1e-10;

void main() {
    uint pixel = group_index() * 64 + gl_LocalInvocationIndex;
    if (pixel >= pixels) return;
    vec2 squares = vec2(0.0);
    for (uint c = 0; c < channels; ++c) {
        vec2 features = vec2(first[c * pixels + pixel], second[c * pixels + pixel]);
        squares += features * features;
    }
    vec2 lengths = sqrt(squares) + TINY;
    float sum = 0.0;
    for (uint c = 0; c < channels; ++c) {
        // `precise`: were one quotient fused into the difference, equal features would differ by its rounding.
        precise float of_first = first[c * pixels + pixel] / lengths.x;
        precise float of_second = second[c * pixels + pixel] / lengths.y;
        precise float difference = of_first - of_second;
        sum += weights[c] * difference * difference;
    }
    distances[pixel] = sum;
}
