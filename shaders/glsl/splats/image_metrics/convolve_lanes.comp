#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_basic : require
// As `convolve`, with the same bits, for CPUs, where each access to memory becomes a loop over lanes: what a lane has read, all
// others take from its register. A workgroup is one subgroup of eight lanes; it makes 32 channels of 32 pixels, a lane all of the
// channels of four pixels. Twin: src/splats/image_metrics/convolve.rs.
#include "shared/group.glsl"
layout(local_size_x = 8) in;
#include "splats/image_metrics/convolution.glsl"

const uint LANES = 8;
// Pixels of a lane.
const uint OWN = 4;
// Of the workgroup: pixels, and channels, of which each lane reads four weights.
const uint PIXELS = 32;
const uint CHANNELS = 32;

void main() {
    uint lane = gl_SubgroupInvocationID, row = (out_channels + TILE - 1) / TILE * QUADS;
    uint groups = (out_channels + CHANNELS - 1) / CHANNELS, pixels = out_width * out_height;
    uint first_pixel = group_index() / groups * PIXELS + lane * OWN, group = group_index() % groups;
    if (group_index() / groups * PIXELS >= pixels) return;
    uvec2 corners[OWN];
    [[unroll]] for (uint p = 0; p < OWN; ++p) corners[p] = corner(first_pixel + p);
    vec4 sums[CHANNELS];
    [[unroll]] for (uint c = 0; c < CHANNELS; ++c) sums[c] = vec4(0.0);

    for (uint index = 0; index < steps * STEP; ++index) {
        uint tap = taps[index];
        vec4 weight = weights[index * row + group * LANES + lane], value;
        [[unroll]] for (uint p = 0; p < OWN; ++p) value[p] = read(tap, corners[p]);
        [[unroll]] for (uint c = 0; c < CHANNELS; ++c) sums[c] += subgroupBroadcast(weight[c % 4], c / 4) * value;
    }

    [[unroll]] for (uint c = 0; c < CHANNELS; ++c) {
        uint channel = group * CHANNELS + c;
        if (channel >= out_channels) continue;
        float bias = biases[channel];
        [[unroll]] for (uint p = 0; p < OWN; ++p) {
            uint pixel = first_pixel + p;
            if (pixel < pixels) target[channel * pixels + pixel] = max(sums[c][p] + bias, 0.0);
        }
    }
}
