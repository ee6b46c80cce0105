#version 450
#extension GL_GOOGLE_include_directive : require
// Reads and writes as fast as the device can: the reference for other stages' bandwidth.
#include "shared/group.glsl"
layout(local_size_x = 256) in;
layout(push_constant) uniform Push { uint count; };
layout(binding = 0, std430) readonly buffer Source { uvec4 source[]; };
layout(binding = 1, std430) writeonly buffer Target { uvec4 target[]; };

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i < count) target[i] = source[i];
}
