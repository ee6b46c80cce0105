#version 450
#extension GL_GOOGLE_include_directive : require
// Relocation by expected quality: a workgroup for each of the tenth of splats with the least utility. One under a fifth of the
// median goes to a viewer that is expected to see badly: a viewer of the last iteration is drawn with probability proportional
// to its expected error, and the splat takes its place and direction; where no camera may stand there, it stands anywhere on the
// feasible part of the ray from one of the points that it sees.
#include "shared/bvh.glsl"
#include "shared/plan.glsl"
#include "shared/random.glsl"
#include "shared/look.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) buffer Splats { Splat splats[]; };
layout(binding = 3, std430) readonly buffer Looks { Look looks[]; };
layout(binding = 4, std430) readonly buffer Tallies { Tally tallies[]; };
layout(binding = 5, std430) buffer MomentsBlock { Moments moments[]; };
layout(binding = 6, std430) readonly buffer Order { uint order[]; };
#include "shared/region_types.glsl"
layout(binding = 7, std430) readonly buffer RegionBlock { DeviceRegion region[]; };
layout(binding = 8, std430) readonly buffer FreeDistance { float free_distance[]; };
layout(binding = 9, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 10, std430) readonly buffer Primitives { vec4 primitives[]; };
#include "shared/traverse.glsl"
#include "shared/region.glsl"

// Expected error of a viewer, from its part of the loss.
float error_of(uint viewer, Settings s) {
    return tallies[viewer].sky >= 4.0 ? exp(tallies[viewer].image * float(s.probes)) : 0.0;
}

void main() {
    Settings s = settings[0];
    if (gl_LocalInvocationIndex != 0 || !relocation_due(control[0], s)) return;
    uint iteration = control[0].iteration, planned = s.splats - s.kept;
    uint j = order[gl_WorkGroupID.x];
    float median = moments[order[planned / 2]].utility;
    if (!(moments[j].utility < 0.2 * max(median, 0.0))) return;

    vec4 random = random4(s.seed, 0x72656c76u, iteration, j);
    float all = 0.0;
    for (uint v = 0; v < s.probes; ++v) all += error_of(v, s);
    if (!(all > 0.0)) return;
    float aim = random.x * all;
    uint viewer = 0;
    while (viewer + 1 < s.probes && aim >= error_of(viewer, s)) aim -= error_of(viewer++, s);
    // A look of it that shows the surface, beginning anywhere.
    Look look = looks[viewer * 64];
    uint first = min(uint(random.y * 64.0), 63u);
    for (uint k = 0; k < 64; ++k) {
        look = looks[viewer * 64 + (first + k) % 64];
        if (look.distance > 0.0) break;
    }
    if (!(look.distance > 0.0)) return;
    vec3 place = look.position + look.distance * look.direction;
    if (!region_contains(place)) {
        float reach = trace(look.position, look.direction, 0.0, MISS, false);
        float distance_ = stand_along(look.position, look.direction, reach, random.z, random.w);
        if (distance_ < 0.0) return;
        place = look.position + distance_ * look.direction;
    }
    splats[j].centre = place;
    splats[j].direction = -look.direction;
    moments[j] = Moments(vec3(0.0), 0, vec3(0.0), 0, vec3(0.0), 0, vec3(0.0), median);
}
