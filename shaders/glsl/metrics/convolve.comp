#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// A convolution as networks have it (cross-correlation), its bias and ReLU: the product of the matrix of weights and of
// the patches under the output's pixels, which are gathered as they are needed. A workgroup makes 64 channels of 64
// pixels in steps of 16 taps through shared memory, a thread 8 channels of 8 pixels. Taps are added in their order, so
// a value has the same bits in every run. Twin: src/metrics/image/convolve.rs.
#include "shared/group.glsl"

layout(local_size_x = 64) in;

#include "metrics/convolution.glsl"

shared vec4 weight_tile[STEP * QUADS];
shared vec4 patch_tile[STEP * QUADS];

void main() {
    uint thread = gl_LocalInvocationIndex;
    uint tiles = (out_channels + TILE - 1) / TILE;
    uint pixels = out_width * out_height;
    uint first_pixel = group_index() / tiles * TILE;
    if (first_pixel >= pixels) return;
    uint first_channel = group_index() % tiles * TILE;

    // What this thread brings: four neighbouring pixels (or channels) of every fourth tap.
    uint quad = thread % QUADS;
    uint lane = thread / QUADS;
    uint brought = first_pixel + 4 * quad;
    uvec2 corners[4] = uvec2[](corner(brought), corner(brought + 1), corner(brought + 2), corner(brought + 3));

    // What it sums: two quads of channels by two of pixels.
    uint row = thread / 8;
    uint column = thread % 8;
    vec4 sums[8][2];
    [[unroll]] for (uint i = 0; i < 8; ++i) sums[i][0] = sums[i][1] = vec4(0.0);

    for (uint step_index = 0; step_index < steps; ++step_index) {
        [[unroll]] for (uint i = 0; i < STEP / 4; ++i) {
            uint s = lane + 4 * i;
            uint index = step_index * STEP + s;
            uint tap = taps[index];
            weight_tile[s * QUADS + quad] = weights[index * (tiles * QUADS) + first_channel / 4 + quad];
            patch_tile[s * QUADS + quad] =
                vec4(read(tap, corners[0]), read(tap, corners[1]), read(tap, corners[2]), read(tap, corners[3]));
        }
        barrier();
        for (uint s = 0; s < STEP; ++s) {
            vec4 weight[2] = vec4[](weight_tile[s * QUADS + row], weight_tile[s * QUADS + row + 8]);
            vec4 value[2] = vec4[](patch_tile[s * QUADS + column], patch_tile[s * QUADS + column + 8]);
            [[unroll]] for (uint i = 0; i < 8; ++i) {
                sums[i][0] += weight[i / 4][i % 4] * value[0];
                sums[i][1] += weight[i / 4][i % 4] * value[1];
            }
        }
        barrier();
    }

    [[unroll]] for (uint i = 0; i < 8; ++i) {
        uint channel = first_channel + 32 * (i / 4) + 4 * row + i % 4;
        if (channel >= out_channels) continue;
        float bias = biases[channel];
        [[unroll]] for (uint j = 0; j < 8; ++j) {
            uint pixel = first_pixel + 32 * (j / 4) + 4 * column + j % 4;
            if (pixel < pixels) target[channel * pixels + pixel] = max(sums[i][j / 4][j % 4] + bias, 0.0);
        }
    }
}
