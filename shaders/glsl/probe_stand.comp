#version 450
#extension GL_GOOGLE_include_directive : require
// From how far away a point camera is to be seen along each texel, once for the whole run: the logarithm of a distance drawn
// from the feasible, unblocked part of the ray. Twin: src/visibility/probe_stand.rs.
#include "shared/group.glsl"
#include "shared/octahedral.glsl"
#include "shared/probe.glsl"
#include "shared/random.glsl"
#include "shared/region_types.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint texels;      // of all probes
    uint resolution;  // texels along a side
    uint seed;
};

layout(binding = 0, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 1, std430) readonly buffer Depth { float depth[]; };
layout(binding = 2, std430) readonly buffer RegionBlock { DeviceRegion region[]; };
layout(binding = 3, std430) readonly buffer FreeDistance { float free_distance[]; };
layout(binding = 4, std430) writeonly buffer Stands { float stands[]; };
#include "shared/region.glsl"

const uint STREAM = 0x7374616eu;
// Where a texel asks for no distance.
const float ANY = 1e30;

void main() {
    uint index = group_index() * 64 + gl_LocalInvocationIndex;
    if (index >= texels) return;
    uint probe = index / (resolution * resolution), texel = index % (resolution * resolution);
    float reach = depth[index], distance_ = -1.0;
    if (reach > 0.0) {
        vec4 random = random4(seed, STREAM, probe, texel);
        vec3 w = octahedral_texel_centre(texel, resolution);
        distance_ = stand_along(probes[probe].position, w, reach, random.x, random.y);
    }
    stands[index] = distance_ > 0.0 ? log(distance_) : ANY;
}
