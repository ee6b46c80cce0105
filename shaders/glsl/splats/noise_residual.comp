#version 450
#extension GL_GOOGLE_include_directive : require
// Manifold sampling, 2: the gradient of the mean square difference of two pictures by each pixel of the first.
#include "shared/group.glsl"
layout(local_size_x = 256) in;

layout(push_constant) uniform Push { uint pixels; };

layout(binding = 0, std430) readonly buffer Picture { vec4 picture[]; };
layout(binding = 1, std430) readonly buffer Target { vec4 target[]; };
layout(binding = 2, std430) writeonly buffer ByPixel { vec4 by_pixel[]; };

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i < pixels) by_pixel[i] = vec4(2.0 / float(3 * pixels) * (picture[i].xyz - target[i].xyz), 0.0);
}
