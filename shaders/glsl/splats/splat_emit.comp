#version 450
#extension GL_GOOGLE_include_directive : require
// Gaussian splatting, 3: an instance per tile of each Gaussian, in the order of depth, and where each Gaussian's instances
// are. A workgroup lists the rows of tiles that its Gaussians reach, a thread a row, then writes their instances, a thread an
// instance: no thread waits for another whose Gaussian is larger.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/tiles.glsl"
const uint THREADS = 64;
layout(local_size_x = THREADS) in;

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

// Of the workgroup's Gaussians: what they reach, and their rows of tiles, up to each.
shared Reach reaches[THREADS];
shared uint splats[THREADS];
shared uint rows_to[THREADS];
// Of as many of these rows: their instances, up to each, its first tile and its Gaussian.
shared uint instances_to[THREADS];
shared uint first_tile[THREADS];
shared uint splat_of[THREADS];

// Makes sums over a thread's and all earlier ones' of values. Uniform control flow; all threads may read at once. With 64
// threads faster than line_scan.glsl.
#define SUM_UP(values, thread) \
    barrier(); \
    for (uint apart = 1; apart < THREADS; apart <<= 1) { \
        uint earlier = (thread) >= apart ? values[(thread) - apart] : 0; \
        barrier(); \
        values[thread] += earlier; \
        barrier(); \
    }

// The first place of sums that has more than `number`, which the last one has.
#define FIND(place, sums, number) \
    uint place = 0; \
    for (uint step = THREADS / 2; step > 0; step >>= 1) place += sums[place + step - 1] <= (number) ? step : 0

void main() {
    uint thread = gl_LocalInvocationIndex, first = group_index() * THREADS, rank = first + thread;
    if (first >= population[0]) return;
    uvec2 tiles = tiles_of(views[view]);
    rows_to[thread] = 0;
    if (rank < population[0]) {
        uint splat = depth_splats[rank], count = tile_counts[rank];
        runs[splat] = uvec2(tile_offsets[rank], count);
        if (count > 0) {
            Reach reach = reach_of(projected[splat], tiles);
            reaches[thread] = reach;
            splats[thread] = splat;
            rows_to[thread] = uint(reach.end - reach.first);
        }
    }
    SUM_UP(rows_to, thread);

    // Counts are sums over rows, so that a row's instances begin where those of the rows before it end.
    uint rows = rows_to[THREADS - 1], at = tile_offsets[first];
    for (uint done = 0; done < rows; done += THREADS) {
        uint number = done + thread;
        instances_to[thread] = 0;
        if (number < rows) {
            FIND(owner, rows_to, number);
            Reach reach = reaches[owner];
            int row = reach.end - int(rows_to[owner] - number);
            ivec2 run = tiles_in_row(reach, row, tiles);
            instances_to[thread] = uint(run.y - run.x);
            first_tile[thread] = uint(row) * tiles.x + uint(run.x);
            splat_of[thread] = splats[owner];
        }
        SUM_UP(instances_to, thread);
        uint instances = instances_to[THREADS - 1];
        for (uint k = thread; k < instances && at + k < capacity; k += THREADS) {
            FIND(row, instances_to, k);
            tile_keys[at + k] = first_tile[row] + k - (row > 0 ? instances_to[row - 1] : 0);
            tile_instances[at + k] = at + k;
            instance_splats[at + k] = splat_of[row];
        }
        at += instances;
        barrier();
    }
}
