#version 450
#extension GL_GOOGLE_include_directive : require
// Scales the lobe of each probe so that its mean over the directions from which the region sees the probe is 1: a target
// that varies over them keeps its mean. A workgroup per probe, once for the whole run. Twin: src/visibility/probe_lobe.rs.
#include "shared/lobe.glsl"
#include "shared/octahedral.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint resolution; };
layout(binding = 0, std430) readonly buffer Depth { float depth[]; };
layout(binding = 1, std430) buffer Lobes { Lobe lobes[]; };

// A lobe that is nearly dark wherever the region sees the probe is not blown up past this.
const float MOST = 8.0;

shared vec2 sums[64];

void main() {
    uint probe = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x, thread = gl_LocalInvocationIndex;
    if (probe >= lobes.length()) return;
    Lobe lobe = lobes[probe];
    lobe.scale = 1.0;
    uint texels = resolution * resolution;
    vec2 sum = vec2(0.0);
    for (uint t = thread; t < texels; t += 64) {
        if (depth[probe * texels + t] > 0.0) sum += vec2(lobe_at(lobe, octahedral_texel_centre(t, resolution)), 1.0);
    }
    sums[thread] = sum;
    for (uint half_ = 32; half_ > 0; half_ >>= 1) {
        barrier();
        if (thread < half_) sums[thread] += sums[thread + half_];
    }
    if (thread == 0) lobes[probe].scale = min(sums[0].y / max(sums[0].x, 1e-6), MOST);
}
