#version 450
#extension GL_GOOGLE_include_directive : require
// Poses, 3: every view as it was given, with the correction of its pose.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/pose.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint count;
};
layout(binding = 0, std430) readonly buffer Given { View given[]; };
layout(binding = 1, std430) readonly buffer Poses { PoseState poses[]; };
layout(binding = 2, std430) writeonly buffer Views { View views[]; };

// The unit quaternion (w, x, y, z) of a rotation vector.
vec4 quaternion_of(vec3 turn) {
    float angle = length(turn);
    return vec4(cos(0.5 * angle), angle > 1e-6 ? sin(0.5 * angle) / angle * turn : 0.5 * turn);
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= count) return;
    View corrected = given[i];
    float value[LEARNT] = poses[i].value;
    // World-from-camera is turned from the left: so is every axis of the camera, a row of camera-from-world.
    mat3 turn = rotation_of(quaternion_of(vec3(value[0], value[1], value[2])));
    vec3 place = corrected.position + vec3(value[3], value[4], value[5]);
    vec3 x = turn * corrected.row_x.xyz, y = turn * corrected.row_y.xyz, z = turn * corrected.row_z.xyz;
    corrected.position = place;
    corrected.row_x = vec4(x, -dot(x, place));
    corrected.row_y = vec4(y, -dot(y, place));
    corrected.row_z = vec4(z, -dot(z, place));
    views[i] = corrected;
}
