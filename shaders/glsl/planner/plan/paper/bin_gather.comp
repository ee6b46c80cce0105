#version 450
#extension GL_GOOGLE_include_directive : require
// Binned pass, 7 of 8: each pair sums its instances in order and becomes a gradient by the splat's pose.
#include "shared/group.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 4, std430) readonly buffer Pairs { uint pairs[]; };
layout(binding = 5, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 6, std430) readonly buffer Runs { uvec2 runs[]; };
layout(binding = 7, std430) readonly buffer InstanceSums { InstanceSum instance_sums[]; };
layout(binding = 8, std430) writeonly buffer Partials { Gradient partials[]; };
layout(binding = 9, std430) readonly buffer PaperBlock { PaperSettings paper[]; };
layout(binding = 10, std430) readonly buffer ScaleBlock { Scale scale_state[]; };

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    uint slot = group_index() * 64 + gl_LocalInvocationIndex;
    if (control[0].halt != 0 || slot >= min(counts[0], p.capacity)) return;
    InstanceSum sum = InstanceSum(vec3(0.0), 0.0, 0.0, 0.0, 0, 0);
    for (uint i = runs[slot].x; i < runs[slot].x + runs[slot].y; ++i) {
        InstanceSum part = instance_sums[i];
        sum.moment += part.moment;
        sum.total += part.total;
        sum.log_scale += part.log_scale;
        sum.utility += part.utility;
    }
    uint pair = pairs[slot];
    uint index = (control[0].iteration * p.probes + pair / s.splats) % p.pool;
    CameraState splat = splats[pair % s.splats];
    vec3 ray = splat.centre - probes[index].position;
    float d = max(length(ray), 1e-6), scale = exp(scale_state[0].log_scale);
    vec3 n = ray / d;
    Gradient grad = splat_gradient(n, d, gate(-n, splat, p.gate_softness), sum.moment, sum.total, 1.0 / (scale * scale));
    grad.own = sum.log_scale;
    grad.utility = sum.utility;
    partials[slot] = grad;
}
