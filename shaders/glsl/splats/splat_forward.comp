#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_vote : require
// Gaussian splatting, 4: a workgroup composites the pixels of a tile, front to back. At every BLOCK-th instance it leaves a
// checkpoint, from which the backward pass continues. The lanes of a block find out together which instances reach it, and take
// TOGETHER of them at a time: their alphas do not wait for one another.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/bounds.glsl"
#include "splats/blocks.glsl"
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
// By the pixel's place in its tile, row by row.
layout(binding = 8, std430) writeonly buffer Checkpoints { vec4 checkpoints[]; };
// Sum of depths as colours are summed, where DEPTHS.
layout(binding = 9, std430) writeonly buffer Depths { float depths[]; };

const uint THREADS = gl_WorkGroupSize.x;
// Blocks that are worked on side by side, and pixels of a thread, in a block each.
const uint TEAMS = THREADS / LANES;
const uint PIXELS = TILE_PIXELS / THREADS;
// Instances in shared memory, and of these composited at a time.
const uint HELD = 256;
const uint TOGETHER = 4;

shared vec4 places[HELD];  // mean from the centre of the tile's first pixel, logarithm of the opacity, depth
shared vec4 forms[HELD];  // form of the exponent, red
shared vec2 others[HELD];  // green, blue
shared uint reached[HELD];  // blocks
shared uint open;
shared uint last;

// A bit for each of LANES instances from `first` on, before `end`, that reaches one of the blocks.
uint reaching(uint first, uint end, uint lane, uint blocks) {
    if (SUBGROUPS) return subgroupBallot(first + lane < end && (reached[min(first + lane, HELD - 1)] & blocks) != 0).x;
    uint bits = 0;
    for (uint i = 0; i < LANES; i += 8) {
        [[unroll]] for (uint j = 0; j < 8; ++j) {
            uint k = i + j;
            if (first + k < end && (reached[first + k] & blocks) != 0) bits |= 1u << k;
        }
    }
    return bits;
}

void main() {
    View camera = views[view];
    uvec2 tiles = tiles_of(camera);
    uint tile = group_index(), thread = numbered(), lane = thread % LANES, team = thread / LANES;
    if (tile >= tiles.x * tiles.y) return;
    uvec2 range = ranges[tile], corner = TILE * uvec2(tile % tiles.x, tile / tiles.x);
    vec4 sum[PIXELS];
    float depth[PIXELS];
    uint end[PIXELS];
    bool done[PIXELS];
    uint blocks = 0;
    [[unroll]] for (uint p = 0; p < PIXELS; ++p) {
        uvec2 pixel = corner + pixel_in(p * TEAMS + team, lane);
        sum[p] = vec4(0.0, 0.0, 0.0, 1.0);
        depth[p] = 0.0;
        end[p] = range.x;
        done[p] = pixel.x >= camera.width || pixel.y >= camera.height;
        blocks |= 1u << p * TEAMS + team;
    }
    if (thread == 0) last = range.x;
    for (uint base = range.x, next; base < range.y; base = next) {
        next = min(range.y, (base / HELD + 1) * HELD);
        barrier();
        if (thread == 0) open = 0;
        barrier();
        bool all_done = true;
        [[unroll]] for (uint p = 0; p < PIXELS; ++p) all_done = all_done && done[p];
        if (!all_done) atomicOr(open, 1);
        for (uint k = thread; k < HELD; k += THREADS) {
            reached[k] = 0;
            if (base + k < next) {
                Projected splat = projected[instance_splats[tile_instances[base + k]]];
                places[k] = vec4(splat.mean - vec2(corner) - 0.5, log2(splat.opacity), splat.depth);
                forms[k] = vec4(form_of(splat), splat.colour.x);
                others[k] = splat.colour.yz;
                reached[k] = blocks_of(bounds_within(splat, corner));
            }
        }
        barrier();
        if (open == 0) break;
        for (uint from = base, to; from < next; from = to) {
            to = min(next, (from / BLOCK + 1) * BLOCK);
            if (from > range.x) {
                [[unroll]] for (uint p = 0; p < PIXELS; ++p) {
                    uvec2 local = pixel_in(p * TEAMS + team, lane);
                    checkpoints[from / BLOCK * TILE_PIXELS + local.y * TILE + local.x] = sum[p];
                }
            }
            for (uint first = from - base; first < to - base; first += LANES) {
                all_done = true;
                [[unroll]] for (uint p = 0; p < PIXELS; ++p) all_done = all_done && done[p];
                if (SUBGROUPS ? subgroupAll(all_done) : all_done) break;
                for (uint bits = reaching(first, to - base, lane, blocks); bits != 0;) {
                    uint at[TOGETHER];
                    bool there[TOGETHER];
                    vec4 place[TOGETHER], form[TOGETHER];
                    vec2 other[TOGETHER];
                    [[unroll]] for (uint i = 0; i < TOGETHER; ++i) {
                        there[i] = bits != 0;
                        at[i] = first + (there[i] ? findLSB(bits) : 0);
                        bits &= bits - 1;
                        place[i] = places[at[i]];
                        form[i] = forms[at[i]];
                        other[i] = others[at[i]];
                    }
                    [[unroll]] for (uint p = 0; p < PIXELS; ++p) {
                        uint block = p * TEAMS + team;
                        float alpha[TOGETHER];
                        [[unroll]] for (uint i = 0; i < TOGETHER; ++i) {
                            vec2 d = vec2(pixel_in(block, lane)) - place[i].xy;
                            float power = log_alpha(d, form[i].xyz, place[i].z);
                            alpha[i] = there[i] && power >= MIN_LOG_ALPHA ? min(MAX_ALPHA, exp2(power)) : 0.0;
                        }
                        [[unroll]] for (uint i = 0; i < TOGETHER; ++i) {
                            float left = sum[p].w * (1.0 - alpha[i]);
                            done[p] = done[p] || left < MIN_TRANSMITTANCE;
                            float weight = done[p] ? 0.0 : sum[p].w * alpha[i];
                            sum[p].xyz += weight * vec3(form[i].w, other[i]);
                            if (DEPTHS) depth[p] += weight * place[i].w;
                            sum[p].w = done[p] ? sum[p].w : left;
                            end[p] = alpha[i] > 0.0 && !done[p] ? base + at[i] + 1 : end[p];
                        }
                    }
                }
            }
        }
    }
    uint latest = range.x;
    [[unroll]] for (uint p = 0; p < PIXELS; ++p) {
        uvec2 pixel = corner + pixel_in(p * TEAMS + team, lane);
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
