#version 450
#extension GL_GOOGLE_include_directive : require
// Gaussian splatting, 3: an instance per tile of each Gaussian, in the order of depth, and where each Gaussian's instances
// are. Those of few Gaussians that reach many tiles are written by the whole workgroup.
#include "shared/group.glsl"
#include "gaussians/gaussian.glsl"
#include "gaussians/frame.glsl"
#include "gaussians/tiles.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 3, std430) readonly buffer DepthSplats { uint depth_splats[]; };
layout(binding = 4, std430) readonly buffer TileCounts { uint tile_counts[]; };
layout(binding = 5, std430) readonly buffer TileOffsets { uint tile_offsets[]; };
layout(binding = 6, std430) writeonly buffer TileKeys { uint tile_keys[]; };
layout(binding = 7, std430) writeonly buffer TileInstances { uint tile_instances[]; };
layout(binding = 8, std430) writeonly buffer InstanceSplats { uint instance_splats[]; };
layout(binding = 9, std430) writeonly buffer Runs { uvec2 runs[]; };

// Tiles that a thread writes by itself.
const uint FEW = 32;

shared uint large[64];
shared uint large_count;

// Writes a row's instances from `at` on, not past `end`; returns where the next row's begin.
uint emit_row(Reach reach, int row, uvec2 tiles, uint splat, uint at, uint end) {
    ivec2 run = tiles_in_row(reach, row, tiles);
    for (int x = run.x; x < run.y && at < end; ++x, ++at) {
        tile_keys[at] = uint(row) * tiles.x + uint(x);
        tile_instances[at] = at;
        instance_splats[at] = splat;
    }
    return at;
}

void main() {
    uint thread = gl_LocalInvocationIndex, first = group_index() * 64, rank = first + thread;
    uvec2 tiles = tiles_of(views[view]);
    if (thread == 0) large_count = 0;
    barrier();
    if (rank < population[0]) {
        uint splat = depth_splats[rank], count = tile_counts[rank], at = tile_offsets[rank];
        uint end = min(at + count, room);
        runs[splat] = uvec2(at, count);
        if (count > FEW) {
            large[atomicAdd(large_count, 1)] = rank;
        } else if (count > 0) {
            Reach reach = reach_of(projected[splat], tiles);
            for (int row = reach.first; row < reach.end; ++row) at = emit_row(reach, row, tiles, splat, at, end);
        }
    }
    barrier();
    for (uint k = 0; k < large_count; ++k) {
        uint splat = depth_splats[large[k]], at = tile_offsets[large[k]];
        uint end = min(at + tile_counts[large[k]], room);
        Reach reach = reach_of(projected[splat], tiles);
        // A row each; what lies before it every thread counts by itself.
        for (int row = reach.first, mine = reach.first + int(thread); row < reach.end; ++row) {
            if (row == mine) {
                at = emit_row(reach, row, tiles, splat, at, end);
                mine += 64;
            } else {
                ivec2 run = tiles_in_row(reach, row, tiles);
                at += uint(run.y - run.x);
            }
        }
    }
}
