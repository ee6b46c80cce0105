#version 450
#extension GL_GOOGLE_include_directive : require
// Expected error of what a set of cameras will train: a workgroup per viewer, a thread per look, which finds the views nearest
// to it that see its point (the whole image, exact occlusion) and applies the law. Twin: src/planner/quality/expected.rs.
#include "shared/fold.glsl"
#include "shared/bvh.glsl"
#include "shared/look.glsl"
#include "shared/law.glsl"
layout(local_size_x = 64) in;  // looks of a viewer

layout(push_constant) uniform Push {
    uint views;
    uint first;  // viewer of the first workgroup
};

#include "planner/metrics/view.glsl"

// Of a viewer.
struct ViewerError {
    float error;   // weighted sum of the errors of all looks, over their number
    uint shown;    // looks that show the surface
    uint unseen;   // of these, looks whose point no view sees
    float spare0;
};

layout(binding = 0, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 1, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 2, std430) readonly buffer Looks { Look looks[]; };
layout(binding = 3, std430) readonly buffer Cameras { View cameras[]; };
layout(binding = 4, std430) readonly buffer LawBlock { Law law[]; };
layout(binding = 5, std430) writeonly buffer Errors { float errors[]; };  // by look; negative where no view sees the point
layout(binding = 6, std430) writeonly buffer ViewerErrors { ViewerError viewer_errors[]; };
#include "shared/traverse.glsl"


float view_cost(uint view, Look look, float bound, out vec3 n, out float d) {
    View camera = cameras[view];
    vec3 ray = camera.position - look.position;
    d = max(length(ray), 1e-6);
    n = ray / d;
    float angle = angle_between(look.direction, n);
    if (angle >= bound) return FARTHEST;
    float z = -dot(n, camera.forward);
    bool inside = z > 0.0 && abs(dot(n, camera.right)) <= z && abs(dot(n, camera.down)) <= z;
    if (!inside || dot(n, look.normal) <= 0.0 && look.normal != vec3(0.0)) return FARTHEST;
    return angle;
}
#include "shared/nearest_views.glsl"

shared float sums[64];
shared uint counts[64];

void main() {
    uint viewer = first + gl_WorkGroupID.x, thread = gl_LocalInvocationIndex;
    Look look = looks[viewer * 64 + thread];
    float error = 0.0;
    uint count = 0;
    if (look.distance > 0.0) {
        Near found[3];
        uint have = nearest_views(look, views, found);
        vec3 angles = vec3(FARTHEST);
        for (uint k = 0; k < 3; ++k) if (k < have) angles[k] = found[k].cost;
        float log_ratio = 0.0;
        if (have > 0) {
            vec3 n;
            float d;
            view_cost(found[0].view, look, FARTHEST, n, d);
            View nearest = cameras[found[0].view];
            log_ratio = log(d / (min(length(nearest.right), length(nearest.down)) * look.footprint));
        }
        error = look.weight * law_error(law[0], angles, log_ratio);
        // Looks, those of the surface, and those of its points that no view sees: eight bits each.
        count = look.normal == vec3(0.0) ? 1u : (have > 0 ? 0x101u : 0x10101u);
    }
    errors[viewer * 64 + thread] = count > 0xffffu ? -error : error;
    sums[thread] = error;
    counts[thread] = count;
    FOLD(thread, 64, sums[thread] += sums[thread + apart]; counts[thread] += counts[thread + apart]);
    if (thread == 0) {
        uint looked = counts[0] & 0xffu, shown = (counts[0] >> 8u) & 0xffu;
        viewer_errors[viewer] = ViewerError(looked > 0 ? sums[0] / float(looked) : 0.0, shown, counts[0] >> 16u, 0.0);
    }
}
