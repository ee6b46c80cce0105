#version 450
#extension GL_GOOGLE_include_directive : require
// Expected quality and its gradient: a workgroup per viewer of the iteration, a thread per look. Each look finds the camera
// splats nearest to it that see its point; the law gives its expected error; the loss is the mean over viewers of the logarithm
// of the mean error of their looks. Every look writes what it asks of the three splats it depends on to places of its own.
// Twin: src/plan/viewed.rs.
#include "shared/bvh.glsl"
#include "shared/plan.glsl"
#include "shared/look.glsl"
#include "shared/law.glsl"
layout(local_size_x = 64) in;  // looks of a viewer

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { Splat splats[]; };
layout(binding = 3, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 4, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 5, std430) readonly buffer Looks { Look looks[]; };
layout(binding = 6, std430) readonly buffer LawBlock { Law law[]; };
layout(binding = 7, std430) writeonly buffer Slots { uint slots[]; };  // the splat that each partial is of
layout(binding = 8, std430) writeonly buffer Partials { Gradient partials[]; };
layout(binding = 9, std430) writeonly buffer Tallies { Tally tallies[]; };
#include "shared/traverse.glsl"

// The angle at the point between viewer and splat, and how far the splat would have to turn to have the point in its picture.
float view_cost(uint view, Look look, out vec3 n, out float d) {
    Splat splat = splats[view];
    vec3 ray = splat.centre - look.position;
    d = max(length(ray), 1e-6);
    n = ray / d;
    if (dot(n, look.normal) <= 0.0) return 2.0;
    float angle = 2.0 * asin(min(0.5 * length(look.direction - n), 1.0));
    if (angle >= 2.0) return 2.0;
    return angle - settings[0].turn_weight * log(max(gate(-n, splat, settings[0]).open, 1e-30));
}
#include "shared/nearest_views.glsl"

shared vec2 sums[64];

vec2 total_of(vec2 value) {
    uint thread = gl_LocalInvocationIndex;
    barrier();
    sums[thread] = value;
    for (uint half_ = 32; half_ > 0; half_ >>= 1) {
        barrier();
        if (thread < half_) sums[thread] += sums[thread + half_];
    }
    barrier();
    return sums[0];
}

// The law of up to four costs in order, where one of them may be left out.
float without(vec4 costs, uint left_out, vec4 log_ratios) {
    vec3 angles;
    uint to = 0;
    for (uint k = 0; k < 4 && to < 3; ++k) if (k != left_out) angles[to++] = costs[k];
    return law_at(law[0], angles, left_out == 0 ? log_ratios.y : log_ratios.x);
}

void main() {
    Settings s = settings[0];
    if (control[0].halt != 0) return;
    uint viewer = gl_WorkGroupID.x, thread = gl_LocalInvocationIndex, place = viewer * 64 + thread;
    Look look = looks[place];
    bool shown = look.distance > 0.0;
    Near found[4];
    uint have = 0;
    vec4 costs = vec4(FARTHEST), log_ratios = vec4(0.0);
    vec3 n[4];
    float d[4];
    for (uint k = 0; k < 4; ++k) {
        n[k] = vec3(0.0);
        d[k] = 1.0;
        found[k] = Near(2.0, NONE);
    }
    float value = 0.0, error = 0.0;
    if (shown) {
        have = nearest_views(look, control[0].live, 4, found);
        for (uint k = 0; k < have; ++k) {
            costs[k] = view_cost(found[k].view, look, n[k], d[k]);
            log_ratios[k] = log(d[k] / look.distance);
        }
        value = without(costs, 4, log_ratios);
        error = exp(value);
    }
    vec2 total = total_of(vec2(error, shown ? 1.0 : 0.0));
    // The loss of a viewer is log(total.x / total.y): each look's part of its gradient.
    float viewers = float(s.probes), weight = shown ? error / (total.x * viewers) : 0.0;
    for (uint k = 0; k < 3; ++k) {
        uint record = place * 3 + k;
        Gradient grad = Gradient(vec3(0.0), 0.0, vec3(0.0), 0.0);
        bool counts = k < have && total.y >= 4.0;
        slots[record] = counts ? found[k].view : NONE;
        if (!counts) continue;
        Gate g = gate(-n[k], splats[found[k].view], s);
        float by_cost = weight * law[0].angle[k];
        // By the unit direction n: of the angle, whose chord is 2 sin(angle/2), and of the turn, whose gate looks along -n.
        float cosine = clamp(dot(look.direction, n[k]), -1.0, 1.0), sine = sqrt(max(1.0 - cosine * cosine, 1e-8));
        vec3 by_n = by_cost * (-look.direction / sine + s.turn_weight * g.by_view);
        grad.centre = (by_n - dot(by_n, n[k]) * n[k]) / d[k];
        if (k == 0) {
            if (log_ratios.x > 0.0) grad.centre += weight * law[0].farther / d[k] * n[k];
        }
        grad.direction = -by_cost * s.turn_weight * g.by_direction;
        // The rise of the loss if this splat were not there, as far as this look goes.
        grad.utility = weight * (exp(without(costs, k, log_ratios) - value) - 1.0);
        partials[record] = grad;
    }
    if (thread == 0) {
        bool counts = total.y >= 4.0;
        tallies[viewer] = Tally(counts ? log(total.x / total.y) / viewers : 0.0, 0.0, 0.0, total.y, 0);
    }
}
