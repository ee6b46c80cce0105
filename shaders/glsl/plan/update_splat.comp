#version 450
#extension GL_GOOGLE_include_directive : require
// The end of an iteration where point cameras' pictures should be evenly bright: sums over probes, and the coverage
// regulariser.
// Twins: src/plan/update.rs (regulariser) and src/plan/dense.rs (the sums).
#include "plan/update.glsl"
layout(binding = 14, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 15, std430) readonly buffer Depth { float depth[]; };

// w_i: mean squared deficit over the probe's reachable directions.
float coverage_weight(uint probe, Settings s) {
    vec2 sum = vec2(0.0);
    for (uint b = probe * s.blocks; b < (probe + 1) * s.blocks; ++b) sum += vec2(tallies[b].short_fall, tallies[b].sky);
    return sum.x / max(sum.y, 1.0);
}

void gather(uint j, Splat splat, Settings s, Control c, uint thread, inout Gradient sum, inout float reg) {
    float share = 1.0 / (float(s.probes) * float(c.live));
    for (uint p = thread; p < s.probes * s.blocks; p += THREADS) {
        uint slot = slots[p / s.blocks * s.splats + j];
        if (slot == NONE) continue;
        Gradient part = partials[p * s.row + slot];
        sum.centre += part.centre;
        sum.direction += part.direction;
        sum.utility += part.utility;
    }
    if (j >= c.live) return;
    for (uint i = thread; i < s.probes; i += THREADS) {
        uint index = (c.iteration * s.probes + i) % s.pool;
        vec3 ray = splat.centre - probes[index].position;
        float d = max(length(ray), 1e-6);
        vec3 n = ray / d;
        if (!OCCLUSION || d < abs(depth[index * TEXELS + octahedral_texel(n, RESOLUTION)])) {
            float weight = coverage_weight(i, s) * share;
            float turned = 1.0 + dot(splat.direction, n);  // 1 - c
            reg += weight * turned;
            sum.direction += s.lambda_reg * weight * n;
            sum.centre += s.lambda_reg * weight / d * (splat.direction - dot(splat.direction, n) * n);
        }
    }
}
