#version 450
#extension GL_GOOGLE_include_directive : require
// The largest value under a square window, channel by channel; windows lie inside the input. Twin:
// src/splats/image_metrics/max_pool.rs.
#include "shared/group.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint width; // of the input
    uint height;
    uint channels;
    uint out_width;
    uint out_height;
    uint window;
    uint stride;
};

layout(binding = 0, std430) readonly buffer Source { float source[]; };
layout(binding = 1, std430) writeonly buffer Target { float target[]; };

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= channels * out_width * out_height) return;
    uint x = i % out_width * stride;
    uint y = i / out_width % out_height * stride;
    uint first = (i / (out_width * out_height) * height + y) * width + x;
    float largest = source[first];
    for (uint v = 0; v < window; ++v) {
        for (uint u = 0; u < window; ++u) largest = max(largest, source[first + v * width + u]);
    }
    target[i] = largest;
}
