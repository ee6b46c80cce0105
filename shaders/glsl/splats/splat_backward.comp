#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_shuffle : require
// Gaussian splatting, 5: the gradient of the loss by what each instance brings to its tile. Each instance has a place of its
// own to write to, so that no order of execution can show.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/bounds.glsl"
#include "splats/blocks.glsl"
layout(local_size_x = 8, local_size_x_id = 1) in;  // LANES

layout(binding = 3, std430) readonly buffer InstanceSplats { uint instance_splats[]; };
// SUMS values of each instance, in the order in which they were emitted.
layout(binding = 12, std430) writeonly buffer Partials { float partials[]; };

#include "splats/sums.glsl"

void leave(uint instance, uint value, float sum) {
    partials[SUMS * instance + value] = sum;
}

#include "splats/backward.glsl"
