#version 450
#extension GL_GOOGLE_include_directive : require
// Orders the splats by utility for relocation: order[k] is the splat with the k-th least. Ties go by index, kept splats
// last. N^2 comparisons every few dozen iterations cost less than a sort up to tens of thousands of views.
#include "shared/group.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer MomentsBlock { Moments moments[]; };
layout(binding = 3, std430) writeonly buffer Order { uint order[]; };
layout(binding = 4, std430) readonly buffer PaperBlock { PaperSettings paper[]; };

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    uint j = group_index() * 64 + gl_LocalInvocationIndex;
    if (j >= s.splats || !relocation_due(control[0], p)) return;
    float mine = moments[j].utility;
    uint rank = 0;
    // Four at a time: lavapipe ends an invocation's loops after 65,535 iterations.
    for (uint first = s.kept; first < s.splats; first += 4) {
        for (uint i = 0; i < 4; ++i) {
            uint k = first + i;
            float other = moments[min(k, s.splats - 1)].utility;
            if (k < s.splats && (other < mine || (other == mine && k < j))) ++rank;
        }
    }
    order[j < s.kept ? s.splats - s.kept + j : rank] = j;
}
