#version 450
#extension GL_GOOGLE_include_directive : require
// The light map's cells as their sums have them. Twin: src/lab/path_tracer/lightmap/bake.rs.
#include "shared/group.glsl"
#include "lab/path_tracer/appearance.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint count; };

layout(binding = 0, std430) readonly buffer Sums { Sum sums[]; };
layout(binding = 1, std430) writeonly buffer Cells { vec4 cells[]; };

void main() {
    uint cell = group_index() * 64 + gl_LocalInvocationIndex;
    if (cell >= count) return;
    Sum sum = sums[cell];
    vec3 all = sum.direct + sum.bounced + sum.compact;
    cells[cell] = sum.rays > 0.0 ? vec4(all / sum.rays, 0.0) : vec4(0.0);
}
