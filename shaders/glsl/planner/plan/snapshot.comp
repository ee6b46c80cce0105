#version 450
#extension GL_GOOGLE_include_directive : require
// Keeps the splats as they are every `interval` iterations, so that held-out metrics can be computed by iteration afterwards
// without stopping the run.
#include "shared/group.glsl"
#include "planner/plan/plan.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint interval; };
layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) writeonly buffer Snapshots { CameraState snapshots[]; };

void main() {
    uint j = group_index() * 64 + gl_LocalInvocationIndex, n = settings[0].splats;
    if (control[0].halt != 0 || j >= n || control[0].iteration % interval != 0) return;
    snapshots[control[0].iteration / interval * n + j] = splats[j];
}
