#version 450
#extension GL_GOOGLE_include_directive : require
// Manifold sampling, 3: a step of Adam for the noise of every parameter: less where the perturbed picture suffers from it, more
// by the reward, never negative.
#include "shared/adam.glsl"
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "splats/noise.glsl"
#include "splats/gaussian.glsl"
layout(local_size_x = 256) in;

layout(push_constant) uniform Push {
    // From one plane of parameters to the next.
    uint stride;
    // Values: planes times Gaussians.
    uint count;
    // Which of each parameter's draws the picture was of.
    uint draw;
    uint spare0;
    uvec2 seed;
    // What the noise of a parameter gains.
    float reward;
    // Corrections of Adam's moments for their start at zero.
    float first_correction;
    float second_correction;
    // Adam's rates.
    float centre_rate;
    float scale_rate;
    float rotation_rate;
    float opacity_rate;
    float colour_rate;
    float harmonics_rate;
    // Most noise, in rates.
    float most;
};

// A tenth of the gradient by each perturbed parameter.
layout(binding = 0, std430) readonly buffer Tenths { float tenths[]; };
layout(binding = 1, std430) restrict buffer Scales { float scales[]; };
layout(binding = 2, std430) restrict buffer Means { float means[]; };
layout(binding = 3, std430) restrict buffer Squares { float squares[]; };

float rate_of(uint plane) {
    if (plane < LOG_SCALE) return centre_rate;
    if (plane < ROTATION) return scale_rate;
    if (plane < OPACITY) return rotation_rate;
    if (plane < HARMONICS) return opacity_rate;
    return plane < HARMONICS + 3 ? colour_rate : harmonics_rate;
}

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i >= count) return;
    float gradient = 10.0 * tenths[i] * perturbation(seed, i, draw) - reward, rate = rate_of(i / stride);
    float m = means[i], v = squares[i];
    adam_means(gradient, m, v);
    means[i] = m;
    squares[i] = v;
    float moved = scales[i] - adam_step(rate, m, v, vec2(first_correction, second_correction), 1e-15);
    scales[i] = clamp(moved, 0.0, most * rate);
}
