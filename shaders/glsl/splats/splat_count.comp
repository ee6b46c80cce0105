#version 450
#extension GL_GOOGLE_include_directive : require
// Gaussian splatting, 2: tiles of each Gaussian, in the order of depth.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/tiles.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 3, std430) readonly buffer DepthSplats { uint depth_splats[]; };
layout(binding = 4, std430) writeonly buffer TileCounts { uint tile_counts[]; };

void main() {
    uint rank = group_index() * 64 + gl_LocalInvocationIndex;
    if (rank >= population[0]) return;
    uvec2 tiles = tiles_of(views[view]);
    Reach reach = reach_of(projected[depth_splats[rank]], tiles);
    uint count = 0;
    for (int row = reach.first; row < reach.end; ++row) {
        ivec2 run = tiles_in_row(reach, row, tiles);
        count += uint(run.y - run.x);
    }
    tile_counts[rank] = count;
}
