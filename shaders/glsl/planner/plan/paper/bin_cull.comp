#version 450
#extension GL_GOOGLE_include_directive : require
// Binned pass, 1 of 8: a thread per (probe, splat) tests whether the probe can see the splat at all (the gate).
#include "shared/group.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 4, std430) writeonly buffer Flags { uint flags[]; };
layout(binding = 5, std430) readonly buffer PaperBlock { PaperSettings paper[]; };

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    uint pair = group_index() * 256 + gl_LocalInvocationIndex;
    if (control[0].halt != 0 || pair >= p.probes * s.splats) return;
    uint probe = pair / s.splats, j = pair % s.splats;
    bool seen = false;
    if (j < control[0].live) {
        uint index = (control[0].iteration * p.probes + probe) % p.pool;
        vec3 ray = splats[j].centre - probes[index].position;
        vec3 n = ray / max(length(ray), 1e-6);
        seen = gate(-n, splats[j], p.gate_softness).open >= GATE_CUTOFF;
    }
    flags[pair] = seen ? 1 : 0;
}
