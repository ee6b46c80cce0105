#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_shuffle : require
#extension GL_EXT_shader_atomic_float : require
// As `splat_backward`, with sums that go to the Gaussians at once, by atomic additions of floats: in whatever order they come,
// so that no two runs are the same.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/bounds.glsl"
#include "splats/blocks.glsl"
layout(local_size_x = 8, local_size_x_id = 1) in;  // LANES

layout(binding = 3, std430) readonly buffer InstanceSplats { uint instance_splats[]; };
// SUMS values of each Gaussian; zero before.
layout(binding = 12, std430) buffer Partials { float partials[]; };

#include "splats/sums.glsl"

void leave(uint instance, uint value, float sum) {
    if (sum != 0.0) atomicAdd(partials[SUMS * instance_splats[instance] + value], sum);
}

#include "splats/backward.glsl"
