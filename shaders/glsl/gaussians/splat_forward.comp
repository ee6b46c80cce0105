#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Gaussian splatting, 5: a workgroup composites the pixels of a tile, front to back. At every BLOCK-th instance it leaves a
// checkpoint, from which the backward pass continues.
#include "shared/group.glsl"
#include "gaussians/gaussian.glsl"
#include "gaussians/frame.glsl"
#include "gaussians/bounds.glsl"
layout(local_size_x = 256, local_size_x_id = 1) in;
layout(constant_id = 2) const bool DEPTHS = false;

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 2, std430) readonly buffer InstanceSplats { uint instance_splats[]; };
layout(binding = 3, std430) readonly buffer TileInstances { uint tile_instances[]; };
layout(binding = 4, std430) readonly buffer Ranges { uvec2 ranges[]; };
// Colour over the background, and what is left of the light behind.
layout(binding = 5, std430) writeonly buffer Picture { vec4 picture[]; };
// Of each pixel, the first instance that does not count any more.
layout(binding = 6, std430) writeonly buffer Ends { uint ends[]; };
// The same of each tile.
layout(binding = 7, std430) writeonly buffer TileEnds { uint tile_ends[]; };
layout(binding = 8, std430) writeonly buffer Checkpoints { vec4 checkpoints[]; };
// Sum of depths as colours are summed, where DEPTHS.
layout(binding = 9, std430) writeonly buffer Depths { float depths[]; };

const uint THREADS = gl_WorkGroupSize.x;
// Pixels of a thread; their stride is THREADS.
const uint PIXELS = TILE_PIXELS / THREADS;

shared vec4 means[BLOCK];  // mean, opacity, depth
shared vec4 conics[BLOCK];  // conic, red
shared vec2 others[BLOCK];  // green, blue
shared uint strips[BLOCK];
shared uint open;
shared uint last;

void main() {
    View camera = views[view];
    uvec2 tiles = tiles_of(camera);
    uint tile = group_index(), thread = gl_LocalInvocationIndex;
    if (tile >= tiles.x * tiles.y) return;
    uvec2 range = ranges[tile], corner = TILE * uvec2(tile % tiles.x, tile / tiles.x);
    vec2 at[PIXELS];
    vec4 sum[PIXELS];
    float depth[PIXELS];
    uint end[PIXELS];
    bool done[PIXELS];
    for (uint p = 0; p < PIXELS; ++p) {
        uint k = p * THREADS + thread;
        uvec2 pixel = corner + uvec2(k % TILE, k / TILE);
        at[p] = vec2(pixel) + 0.5;
        sum[p] = vec4(0.0, 0.0, 0.0, 1.0);
        depth[p] = 0.0;
        end[p] = range.x;
        done[p] = pixel.x >= camera.width || pixel.y >= camera.height;
    }
    if (thread == 0) last = range.x;
    for (uint base = range.x, next; base < range.y; base = next) {
        next = min(range.y, (base / BLOCK + 1) * BLOCK);
        barrier();
        if (thread == 0) open = 0;
        barrier();
        bool mine = false;
        for (uint p = 0; p < PIXELS; ++p) mine = mine || !done[p];
        if (mine) atomicOr(open, 1);
        if (base > range.x) {
            for (uint p = 0; p < PIXELS; ++p) checkpoints[base / BLOCK * TILE_PIXELS + p * THREADS + thread] = sum[p];
        }
        for (uint k = thread; k < BLOCK; k += THREADS) {
            means[k] = conics[k] = vec4(0.0);
            strips[k] = 0;
            if (base + k < next) {
                Projected splat = projected[instance_splats[tile_instances[base + k]]];
                means[k] = vec4(splat.mean, splat.opacity, splat.depth);
                conics[k] = vec4(splat.conic, splat.colour.x);
                others[k] = splat.colour.yz;
                strips[k] = strips_of(bounds_within(splat, corner));
            }
        }
        barrier();
        if (open == 0) break;
        for (uint b = 0; mine && b < next - base; b += 4) {
            [[unroll]] for (uint i = 0; i < 4; ++i) {
                uint k = b + i;
                // What does not reach a strip is skipped.
                uint reached = strips[k];
                if (PIXELS == 1 && (reached >> thread / STRIP & 1) == 0) continue;
                vec4 mean = means[k], conic = conics[k];
                [[unroll]] for (uint p = 0; p < PIXELS; ++p) {
                    if (PIXELS > 1 && (reached >> (p * THREADS + thread) / STRIP & 1) == 0) continue;
                    vec2 d = at[p] - mean.xy;
                    float sigma = 0.5 * (conic.x * d.x * d.x + conic.z * d.y * d.y) + conic.y * d.x * d.y;
                    float alpha = min(MAX_ALPHA, mean.z * exp(-sigma));
                    if (done[p] || sigma < 0.0 || alpha < MIN_ALPHA) continue;
                    float left = sum[p].w * (1.0 - alpha);
                    if (left < MIN_TRANSMITTANCE) {
                        done[p] = true;
                        continue;
                    }
                    float weight = sum[p].w * alpha;
                    sum[p].xyz += weight * vec3(conic.w, others[k]);
                    if (DEPTHS) depth[p] += weight * mean.w;
                    sum[p].w = left;
                    end[p] = base + k + 1;
                }
            }
            mine = false;
            for (uint p = 0; p < PIXELS; ++p) mine = mine || !done[p];
        }
    }
    uint latest = range.x;
    for (uint p = 0; p < PIXELS; ++p) {
        uint k = p * THREADS + thread;
        uvec2 pixel = corner + uvec2(k % TILE, k / TILE);
        if (pixel.x >= camera.width || pixel.y >= camera.height) continue;
        uint texel = pixel.y * camera.width + pixel.x;
        picture[texel] = vec4(sum[p].xyz + sum[p].w * background, sum[p].w);
        ends[texel] = end[p];
        latest = max(latest, end[p]);
        if (DEPTHS) depths[texel] = depth[p];
    }
    barrier();
    atomicMax(last, latest);
    barrier();
    if (thread == 0) tile_ends[tile] = last;
}
