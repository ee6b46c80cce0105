#version 450
#extension GL_GOOGLE_include_directive : require
// A picture as networks take it: plane by plane, each byte looked up in what it means for its channel. A thread per pixel. Twin:
// src/splats/image_metrics/lpips_planes.rs.
#include "shared/group.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint pixels;
};

layout(binding = 0, std430) readonly buffer Picture { uint picture[]; };  // red, green and blue, a byte each, one after another
layout(binding = 1, std430) readonly buffer Values { float values[]; };   // 256 of each channel
layout(binding = 2, std430) writeonly buffer Planes { float planes[]; };

void main() {
    uint pixel = group_index() * 64 + gl_LocalInvocationIndex;
    if (pixel >= pixels) return;
    for (uint c = 0; c < 3; ++c) {
        uint at = 3 * pixel + c;
        planes[c * pixels + pixel] = values[256 * c + (picture[at / 4] >> (8 * (at % 4)) & 0xff)];
    }
}
