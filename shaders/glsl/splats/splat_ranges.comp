#version 450
#extension GL_GOOGLE_include_directive : require
// Gaussian splatting, 4: where the instances of each tile begin and end in the order of the tiles.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) readonly buffer TileKeys { uint tile_keys[]; };
// Zero before: a tile without instances keeps an empty range.
layout(binding = 2, std430) buffer Ranges { uvec2 ranges[]; };

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex, count = min(counts[0], capacity);
    if (i >= count) return;
    uint key = tile_keys[i];
    if (key >= ranges.length()) return;
    if (i == 0 || tile_keys[i - 1] != key) ranges[key].x = i;
    if (i + 1 == count || tile_keys[i + 1] != key) ranges[key].y = i + 1;
}
