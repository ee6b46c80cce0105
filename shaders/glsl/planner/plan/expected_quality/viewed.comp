#version 450
#extension GL_GOOGLE_include_directive : require
// Expected quality and its gradient, a thread or a workgroup per look. Each look finds the camera splats nearest to it that see its
// point; the law gives its expected error; the loss is the mean over viewers of the logarithm of the mean error of their looks.
// Every look writes the gradients of its error by the three splats it depends on to places of its own; the last of a viewer's looks
// sums their errors, and notes the factor that makes these gradients those of the loss.
// Twin: src/planner/plan/expected_quality/viewed.rs.
#include "shared/group.glsl"
#include "shared/across.glsl"
#include "shared/fold.glsl"
#include "shared/bvh.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/gate.glsl"
#include "planner/plan/expected_quality/settings.glsl"
#include "shared/look.glsl"
#include "shared/law.glsl"
layout(constant_id = 8) const uint LANES = 1;  // threads of a look: 1, or 32, which are a workgroup
layout(local_size_x = 64, local_size_x_id = 9) in;  // with one thread a look the looks of a viewer

layout(push_constant) uniform Push {
    uint first_look;  // of the iteration, among those that were drawn for several at once
};

layout(binding = 0, std430) readonly buffer QualityBlock { QualitySettings quality[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 4, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 5, std430) readonly buffer Looks { Look looks[]; };
layout(binding = 6, std430) readonly buffer LawBlock { Law law[]; };
layout(binding = 7, std430) writeonly buffer Slots { uint slots[]; };  // the splat that each partial is of
layout(binding = 8, std430) writeonly buffer Partials { Gradient partials[]; };
layout(binding = 9, std430) writeonly buffer ViewerLosses { ViewerLoss viewer_losses[]; };
layout(binding = 10, std430) buffer Errors { uint errors[]; };  // by look, as bits; 0: counts for nothing; negative: beside the surface
layout(binding = 11, std430) buffer Arrivals { uint arrivals[]; };  // workgroups of a viewer that are done
#include "shared/traverse.glsl"

QualitySettings q;

// Radians that a splat counts as off for each sine by which the point lies outside of its picture: steep enough that cameras turn
// towards what the hard test counts.
const float TURN = 8.0;

// The angle at the point between viewer and splat, and how far the splat would have to turn to have the point in its picture.
float splat_cost(CameraState splat, Look look, float bound, out vec3 n, out float d) {
    vec3 ray = splat.centre - look.position;
    d = max(length(ray), 1e-6);
    n = ray / d;
    if (dot(n, look.normal) <= 0.0 && look.normal != vec3(0.0)) return FARTHEST;
    float angle = angle_between(look.direction, n);
    if (angle >= bound) return FARTHEST;
    float open = gate(-n, splat, q.gate_softness).open;
    // A closed gate has no logarithm in single precision.
    return open > 1e-30 ? angle - TURN * q.gate_softness * log(open) : FARTHEST;
}

float view_cost(uint view, Look look, float bound, out vec3 n, out float d) {
    return splat_cost(splats[view], look, bound, n, d);
}
#include "shared/nearest_views.glsl"
#include "planner/plan/expected_quality/nearest_together.glsl"

const uint LOOKS = 64;  // of a viewer
const uint THREADS = LANES == 1 ? LOOKS : LANES;

shared vec3 sums[THREADS];
shared bool last;

// Whether this workgroup is the last of a viewer's to have written its errors: only then may it read those of the others.
bool is_last(uint viewer, uint thread) {
    memoryBarrierBuffer();
    barrier();
    if (thread == 0) last = atomicAdd(arrivals[viewer], 1) + 1 == LOOKS * LANES / THREADS;
    barrier();
    memoryBarrierBuffer();
    return last;
}

// The loss of a viewer is log(sum of errors / looks), and each error's part in the gradient its factor.
void tally(uint viewer, uint thread, float viewers) {
    vec3 sum = vec3(0.0);
    for (uint i = thread; i < LOOKS; i += THREADS) {
        float error = got(errors[viewer * LOOKS + i]);
        sum += vec3(abs(error), error != 0.0 ? 1.0 : 0.0, error > 0.0 ? 1.0 : 0.0);
    }
    sums[thread] = sum;
    FOLD(thread, THREADS, sums[thread] += sums[thread + apart]);
    if (thread != 0) return;
    vec3 total = sums[0];
    bool counts = total.z >= 4.0;
    float loss = counts ? log(total.x / total.y) / viewers : 0.0, factor = counts ? 1.0 / (total.x * viewers) : 0.0;
    viewer_losses[viewer] = ViewerLoss(loss, factor);
    arrivals[viewer] = 0;
}

void main() {
    q = quality[0];
    if (control[0].halt != 0) return;
    uint thread = gl_LocalInvocationIndex, lane = thread % LANES;
    uint place = group_index() * (THREADS / LANES) + thread / LANES, viewer = place / LOOKS;
    if (viewer >= q.viewers) return;
    Look look = looks[first_look + place];
    bool looks_at = look.distance > 0.0;
    Near found[3];
    uint have = 0;
    if (looks_at) {
        have = LANES == 1 ? nearest_views(look, control[0].live, found) : nearest_together(look, lane, control[0].live, found);
    }
    vec3 n[3], costs = vec3(FARTHEST);
    float d[3], log_ratio = 0.0, error = 0.0, slope = 0.0;
    if (looks_at) {
        for (uint k = 0; k < have; ++k) costs[k] = view_cost(found[k].view, look, FARTHEST, n[k], d[k]);
        if (have > 0) {
            CameraState nearest = splats[found[0].view];
            log_ratio = log(d[0] * max(nearest.tan_x, nearest.tan_y) / look.footprint);
        }
        error = law_error(law[0], costs, log_ratio);
        slope = look.weight * law_slope(law[0], error);
        error *= look.weight;
    }
    if (lane == 0) put(errors[place], look.normal == vec3(0.0) ? -error : error);
    float turn = TURN * q.gate_softness;
    for (uint k = lane; k < 3; k += LANES) {
        uint record = place * 3 + k;
        slots[record] = k < have ? found[k].view : NONE;
        if (k >= have) continue;
        Gate g = gate(-n[k], splats[found[k].view], q.gate_softness);
        float by_cost = slope * law[0].angle[k];
        // By the unit direction n: of the angle, whose chord is 2 sin(angle/2), and of the turn, whose gate looks along -n.
        float cosine = clamp(dot(look.direction, n[k]), -1.0, 1.0), sine = sqrt(max(1.0 - cosine * cosine, 1e-8));
        vec3 by_n = by_cost * (-look.direction / sine + turn * g.by_view);
        Gradient grad = Gradient((by_n - dot(by_n, n[k]) * n[k]) / d[k], 0.0, -by_cost * turn * g.by_direction, 0.0);
        if (k == 0 && log_ratio > 0.0) grad.centre += slope * law[0].farther / d[k] * n[k];
        partials[record] = grad;
    }
    if (is_last(viewer, thread)) tally(viewer, thread, float(q.viewers));
}
