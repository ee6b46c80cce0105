#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// A convolution as networks have it (cross-correlation), its bias and ReLU: the product of the matrix of weights and of
// the patches under the output's pixels, which are gathered as they are needed. A workgroup makes 64 channels of 64
// pixels in steps of 16 taps through shared memory, a thread 4 channels of 4 pixels. Taps are added in their order, so
// a value has the same bits in every run. Twin: src/splats/image_metrics/convolve.rs.
#include "shared/group.glsl"

layout(local_size_x = 256) in;  // a vector of each tile to bring, and a quad by a quad to sum: STEP * QUADS, and QUADS * QUADS

#include "splats/image_metrics/convolution.glsl"

shared vec4 weight_tile[STEP * QUADS];
shared vec4 patch_tile[STEP * QUADS];

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint tiles = (out_channels + TILE - 1) / TILE;
    uint pixels = out_width * out_height;
    uint first_pixel = group_index() / tiles * TILE;
    if (first_pixel >= pixels) return;
    uint first_channel = group_index() % tiles * TILE;

    // What this thread brings: four neighbouring pixels, and channels, of a tap.
    uint quad = thread % QUADS, tap = thread / QUADS;
    uint brought = first_pixel + 4 * quad;
    uvec2 corners[4] = uvec2[](corner(brought), corner(brought + 1), corner(brought + 2), corner(brought + 3));

    // What it sums: a quad of channels by one of pixels.
    uint row = thread / QUADS, column = thread % QUADS;
    vec4 sums[4] = vec4[](vec4(0.0), vec4(0.0), vec4(0.0), vec4(0.0));

    for (uint step_index = 0; step_index < steps; ++step_index) {
        uint index = step_index * STEP + tap, place = taps[index];
        weight_tile[thread] = weights[index * (tiles * QUADS) + first_channel / 4 + quad];
        patch_tile[thread] =
            vec4(read(place, corners[0]), read(place, corners[1]), read(place, corners[2]), read(place, corners[3]));
        barrier();
        [[unroll]] for (uint s = 0; s < STEP; ++s) {
            vec4 weight = weight_tile[s * QUADS + row], value = patch_tile[s * QUADS + column];
            [[unroll]] for (uint i = 0; i < 4; ++i) sums[i] += weight[i] * value;
        }
        barrier();
    }

    [[unroll]] for (uint i = 0; i < 4; ++i) {
        uint channel = first_channel + 4 * row + i;
        if (channel >= out_channels) continue;
        float bias = biases[channel];
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            uint pixel = first_pixel + 4 * column + j;
            if (pixel < pixels) target[channel * pixels + pixel] = max(sums[i][j] + bias, 0.0);
        }
    }
}
