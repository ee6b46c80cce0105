#version 450
#extension GL_GOOGLE_include_directive : require
// From what part of the sphere does the region see a probe? A workgroup per probe, once for the whole run.
// Twin: src/visibility/probe_depth.rs.
#include "shared/fold.glsl"
#include "shared/probe.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint resolution; };
layout(binding = 0, std430) readonly buffer Depth { float depth[]; };
layout(binding = 1, std430) buffer Probes { Probe probes[]; };

shared uint sums[64];

void main() {
    uint probe = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x, thread = gl_LocalInvocationIndex;
    if (probe >= probes.length()) return;
    uint texels = resolution * resolution, open_sky = 0;
    for (uint t = thread; t < texels; t += 64) open_sky += depth[probe * texels + t] > 0.0 ? 1 : 0;
    sums[thread] = open_sky;
    FOLD(thread, 64, sums[thread] += sums[thread + apart]);
    if (thread == 0) probes[probe].sky = float(sums[0]) / float(texels);
}
