// What the two stages of a convolution share: buffers, and how the input is read.

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

// Row and column of the input under the first tap of an output pixel; beyond the border they wrap, and so fail as too
// large.
uvec2 corner(uint pixel) {
    return uvec2(pixel % out_width, pixel / out_width) * stride - padding;
}

float read(uint tap, uvec2 corner) {
    uvec2 at = corner + uvec2(tap & 0xff, (tap >> 8) & 0xff);
    return at.x < width && at.y < height ? source[((tap >> 16) * height + at.y) * width + at.x] : 0.0;
}
