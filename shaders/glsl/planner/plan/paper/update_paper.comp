#version 450
#extension GL_GOOGLE_include_directive : require
// The end of an iteration where point cameras' pictures should be evenly bright: sums over probes, the coverage regulariser, and a
// step of the shared scale.
// Twins: src/planner/plan/paper/regulariser.rs, src/planner/plan/paper/scale.rs and src/planner/plan/paper/dense.rs (the sums).
#include "planner/plan/update.glsl"
#include "planner/plan/paper/paper.glsl"
#include "shared/octahedral.glsl"
layout(binding = 13, std430) readonly buffer Tallies { Tally tallies[]; };
layout(binding = 14, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 15, std430) readonly buffer Depth { float depth[]; };
layout(binding = 16, std430) readonly buffer PaperBlock { PaperSettings paper[]; };
layout(binding = 17, std430) buffer ScaleBlock { Scale scale_state[]; };

PaperSettings p;

void begin() {
    p = paper[0];
}

// w_i: mean squared deficit over the probe's reachable directions.
float coverage_weight(uint probe) {
    vec2 sum = vec2(0.0);
    for (uint b = probe * p.blocks; b < (probe + 1) * p.blocks; ++b) sum += vec2(tallies[b].short_fall, tallies[b].sky);
    return sum.x / max(sum.y, 1.0);
}

void gather(uint j, CameraState splat, Settings s, Control c, uint thread, inout Gradient sum, inout float penalty) {
    float share = 1.0 / (float(p.probes) * float(c.live));
    for (uint i = thread; i < p.probes * p.blocks; i += THREADS) {
        uint slot = slots[i / p.blocks * s.splats + j];
        if (slot == NONE) continue;
        Gradient part = partials[i * p.row + slot];
        sum.centre += part.centre;
        sum.direction += part.direction;
        sum.utility += part.utility;
    }
    if (j >= c.live) return;
    for (uint i = thread; i < p.probes; i += THREADS) {
        uint index = (c.iteration * p.probes + i) % p.pool;
        vec3 ray = splat.centre - probes[index].position;
        float d = max(length(ray), 1e-6);
        vec3 n = ray / d;
        if (!OCCLUSION || d < abs(depth[index * TEXELS + octahedral_texel(n, RESOLUTION)])) {
            float weight = coverage_weight(i) * share;
            float turned = 1.0 + dot(splat.direction, n);  // 1 - c
            penalty += weight * turned;
            sum.direction += p.lambda_reg * weight * n;
            sum.centre += p.lambda_reg * weight / d * (splat.direction - dot(splat.direction, n) * n);
        }
    }
}

vec2 own_sums(uint thread) {
    vec2 sum = vec2(0.0);
    for (uint i = thread; i < p.probes * p.blocks; i += THREADS) {
        sum += vec2(tallies[i].image, tallies[i].log_scale);
    }
    return sum;
}

float own_step(Control c, float by_log_scale) {
    Scale scale = scale_state[0];
    float before = scale.log_scale;
    if (p.lr_scale > 0.0) {
        float gradient = by_log_scale + 2.0 * p.lambda_scale * exp(2.0 * before);
        adam_means(gradient, scale.mean, scale.square);
        vec2 corrections = adam_corrections(c.step);
        float m = scale.mean / corrections.x, v = scale.square / corrections.y;
        scale.log_scale = max(before - p.lr_scale * c.rate * m / (sqrt(v) + 1e-10), log(p.scale_floor));
        scale_state[0] = scale;
    }
    return before;
}
