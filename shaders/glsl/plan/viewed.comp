#version 450
#extension GL_GOOGLE_include_directive : require
// Expected quality and its gradient: a workgroup per viewer of the iteration, one thread or several per look. Each look finds the camera
// splats nearest to it that see its point; the law gives its expected error; the loss is the mean over viewers of the logarithm
// of the mean error of their looks. Every look writes the gradients of the three splats it depends on to places of its own.
// Twin: src/plan/viewed.rs.
#include "shared/fold.glsl"
#include "shared/bvh.glsl"
#include "plan/plan.glsl"
#include "shared/look.glsl"
#include "shared/law.glsl"
layout(local_size_x = 64, local_size_x_id = 9) in;  // looks of a viewer, times LANES

layout(push_constant) uniform Push {
    uint first_look;  // of the iteration, among those that were drawn for several at once
};

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

// Radians that a splat counts as off for each sine by which the point lies outside of its picture: steep enough that cameras turn
// towards what the hard test counts.
const float TURN = 8.0;

// The angle at the point between viewer and splat, and how far the splat would have to turn to have the point in its picture.
float view_cost(uint view, Look look, float bound, out vec3 n, out float d) {
    Splat splat = splats[view];
    vec3 ray = splat.centre - look.position;
    d = max(length(ray), 1e-6);
    n = ray / d;
    if (dot(n, look.normal) <= 0.0 && look.normal != vec3(0.0)) return FARTHEST;
    float angle = angle_between(look.direction, n);
    if (angle >= bound) return FARTHEST;
    float open = gate(-n, splat, settings[0]).open;
    // A closed gate has no logarithm in single precision.
    return open > 1e-30 ? angle - TURN * settings[0].gate_softness * log(open) : FARTHEST;
}
#include "shared/nearest_views.glsl"

shared vec4 sums[64];

vec4 total_of(vec4 value) {
    uint thread = gl_LocalInvocationIndex;
    barrier();
    if (thread < 64) sums[thread] = value;
    FOLD(thread, 64, sums[thread] += sums[thread + apart]);
    barrier();
    return sums[0];
}

void main() {
    Settings s = settings[0];
    if (control[0].halt != 0) return;
    uint viewer = gl_WorkGroupID.x, thread = gl_LocalInvocationIndex, place = viewer * 64 + thread % 64;
    Look look = looks[first_look + place];
    bool looks_at = look.distance > 0.0, shown = look.normal != vec3(0.0);
    Near found[3];
    uint have = 0;
    vec3 n[3];
    float d[3];
    float error = 0.0, log_ratio = 0.0;
    have = nearest_views(look, looks_at, control[0].live, found);
    if (looks_at) {
        vec3 costs = vec3(FARTHEST);
        for (uint k = 0; k < have; ++k) costs[k] = view_cost(found[k].view, look, FARTHEST, n[k], d[k]);
        if (have > 0) log_ratio = log(d[0] / look.distance);
        error = look.weight * exp(law_at(law[0], costs, log_ratio));
    }
    vec4 total = total_of(vec4(error, looks_at ? 1.0 : 0.0, shown ? 1.0 : 0.0, 0.0));
    // The loss of a viewer is log(total.x / total.y): each look's part of its gradient.
    float turn = TURN * s.gate_softness;
    float viewers = float(s.probes), weight = looks_at ? error / (total.x * viewers) : 0.0;
    for (uint k = 0; thread < 64 && k < 3; ++k) {
        uint record = place * 3 + k;
        Gradient grad = Gradient(vec3(0.0), 0.0, vec3(0.0), 0.0);
        bool counts = k < have && total.z >= 4.0;
        slots[record] = counts ? found[k].view : NONE;
        if (!counts) continue;
        Gate g = gate(-n[k], splats[found[k].view], s);
        float by_cost = weight * law[0].angle[k];
        // By the unit direction n: of the angle, whose chord is 2 sin(angle/2), and of the turn, whose gate looks along -n.
        float cosine = clamp(dot(look.direction, n[k]), -1.0, 1.0), sine = sqrt(max(1.0 - cosine * cosine, 1e-8));
        vec3 by_n = by_cost * (-look.direction / sine + turn * g.by_view);
        grad.centre = (by_n - dot(by_n, n[k]) * n[k]) / d[k];
        if (k == 0 && log_ratio > 0.0) grad.centre += weight * law[0].farther / d[k] * n[k];
        grad.direction = -by_cost * turn * g.by_direction;
        partials[record] = grad;
    }
    if (thread == 0) {
        bool counts = total.z >= 4.0;
        tallies[viewer] = Tally(counts ? log(total.x / total.y) / viewers : 0.0, 0.0, 0.0, total.z, 0);
    }
}
