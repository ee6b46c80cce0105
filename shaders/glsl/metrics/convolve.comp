#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// A convolution as networks have it (cross-correlation), its bias and ReLU: the product of the matrix of weights and of
// the patches under the output's pixels, which are gathered as they are needed. A workgroup makes 64 channels of 64
// pixels in steps of 16 taps through shared memory, a thread 8 channels of 8 pixels. Taps are added in their order, so
// a value has the same bits in every run. Twin: src/metrics/image/convolve.rs.
#include "shared/group.glsl"

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint width;        // of the input
    uint height;
    uint out_channels;
    uint out_width;
    uint out_height;
    uint stride;
    uint padding;      // rows and columns of zeros around the input
    uint steps;        // taps over STEP, rounded up
};

// Taps by channels, both filled up with zeros to whole steps and tiles.
layout(binding = 0, std430) readonly buffer Weights { vec4 weights[]; };
layout(binding = 1, std430) readonly buffer Biases { float biases[]; };
// Where each tap reads: the input's channel, then row and column in the kernel, in 16, 8 and 8 bits.
layout(binding = 2, std430) readonly buffer Taps { uint taps[]; };
layout(binding = 3, std430) readonly buffer Source { float source[]; };
layout(binding = 4, std430) writeonly buffer Target { float target[]; };

// As in convolve.rs.
const uint TILE = 64;
const uint STEP = 16;
// Four to a vector.
const uint QUADS = TILE / 4;

shared vec4 weight_tile[STEP * QUADS];
shared vec4 patch_tile[STEP * QUADS];

// Row and column of the input under the first tap of an output pixel; beyond the border they wrap, and so fail as too
// large.
uvec2 corner(uint pixel) {
    return uvec2(pixel % out_width, pixel / out_width) * stride - padding;
}

float read(uint tap, uvec2 corner) {
    uvec2 at = corner + uvec2(tap & 0xff, (tap >> 8) & 0xff);
    return at.x < width && at.y < height ? source[((tap >> 16) * height + at.y) * width + at.x] : 0.0;
}

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
