#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Fisher information, 2: squares, pixel by pixel, of what red + green + blue answers to each instance's parameters. A workgroup
// takes BLOCK instances of the sorted list, whatever tiles they belong to, and continues from the checkpoint that the forward
// pass left, as the backward pass does.
//
// SPLATS instances at a time: first pixel by pixel, front to back, w and q into shared memory; then column by column of the tile
// the squares, and the sums over columns, each in fixed order.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/bounds.glsl"
#include "splats/fisher.glsl"
layout(local_size_x = 256, local_size_x_id = 1) in;

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 2, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 3, std430) readonly buffer InstanceSplats { uint instance_splats[]; };
layout(binding = 4, std430) readonly buffer TileKeys { uint tile_keys[]; };
layout(binding = 5, std430) readonly buffer TileInstances { uint tile_instances[]; };
layout(binding = 6, std430) readonly buffer Ranges { uvec2 ranges[]; };
layout(binding = 7, std430) readonly buffer Picture { vec4 picture[]; };
layout(binding = 8, std430) readonly buffer Ends { uint ends[]; };
layout(binding = 9, std430) readonly buffer TileEnds { uint tile_ends[]; };
layout(binding = 10, std430) readonly buffer Checkpoints { vec4 checkpoints[]; };
layout(binding = 11, std430) readonly buffer Forms { Form forms[]; };
// SQUARES values of each instance, in the order in which they were emitted.
layout(binding = 12, std430) writeonly buffer Partials { float partials[]; };

const uint THREADS = gl_WorkGroupSize.x;
const uint PIXELS = TILE_PIXELS / THREADS;
const uint SPLATS = 8;
// Pixels of a splat's row in shared memory, with what keeps rows out of one another's banks.
const uint ROW = TILE_PIXELS + 4;
const uint BITS = 5;

shared vec4 places[BLOCK];  // mean from the centre of the tile's first pixel, logarithm of the opacity, xx of the exponent's form
shared vec4 others[BLOCK];  // xy and yy of it, red + green + blue
// First pixel in x and y within the instance's tile, and one past the last, five bits each; above them its strips.
shared uint bounds[BLOCK];
shared float weights[SPLATS * ROW];
shared float slopes[SPLATS * ROW];
shared float sums[SQUARES * SPLATS * TILE];

// A bit for each STRIP of two rows of pixels that bounds reach into. Threads with consecutive numbers share strips, so that
// most of them agree on what to leave out.
const uint STRIP = 2 * TILE;

uint strips_of(uvec4 bounds) {
    uint first = bounds.y / 2, end = (bounds.w + 1) / 2;
    return bounds.x < bounds.z && first < end ? (1u << end) - (1u << first) : 0;
}

// Squares over a column of the tile: of instance `k` of the block, which is splat `s` of those in shared memory.
void square_column(uint s, uint k, uint column, uint splat) {
    uvec4 inside = uvec4(bounds[k], bounds[k] >> BITS, bounds[k] >> 2 * BITS, bounds[k] >> 3 * BITS) & ((1u << BITS) - 1);
    if (column < inside.x || column >= inside.z) {
        [[unroll]] for (uint v = 0; v < SQUARES; ++v) sums[(v * SPLATS + s) * TILE + column] = 0.0;
        return;
    }
    Form form[FORMS];
    [[unroll]] for (uint f = 0; f < FORMS; ++f) form[f] = forms[FORMS * splat + f];
    vec2 origin = -places[k].xy;
    float sum[SQUARES];
    [[unroll]] for (uint v = 0; v < SQUARES; ++v) sum[v] = 0.0;
    for (uint row = inside.y; row < inside.w; ++row) {
        vec2 d = origin + vec2(column, row);
        vec3 dd = vec3(d.x * d.x, d.x * d.y, d.y * d.y);
        float w = weights[s * ROW + row * TILE + column], q = slopes[s * ROW + row * TILE + column];
        sum[0] += w * w;
        sum[1] += q * q;
        [[unroll]] for (uint f = 0; f < FORMS; ++f) {
            float answer = w * form[f].weight + q * (form[f].constant + dot(form[f].linear, d) + dot(form[f].quadratic, dd));
            sum[2 + f] += answer * answer;
        }
    }
    [[unroll]] for (uint v = 0; v < SQUARES; ++v) sums[(v * SPLATS + s) * TILE + column] = sum[v];
}

void main() {
    View camera = views[view];
    uint thread = gl_LocalInvocationIndex, first = group_index() * BLOCK;
    uint stop = min(first + BLOCK, min(counts[0], capacity));
    if (first >= stop) return;
    uint wide = tiles_of(camera).x;
    for (uint k = thread; k < BLOCK; k += THREADS) {
        places[k] = others[k] = vec4(0.0);
        bounds[k] = 0;
        if (first + k < stop) {
            Projected splat = projected[instance_splats[tile_instances[first + k]]];
            uint tile = tile_keys[first + k];
            uvec2 corner = TILE * uvec2(tile % wide, tile / wide);
            vec3 form = form_of(splat);
            places[k] = vec4(splat.mean - vec2(corner) - 0.5, log2(splat.opacity), form.x);
            others[k] = vec4(form.yz, splat.colour.x + splat.colour.y + splat.colour.z, 0.0);
            uvec4 b = bounds_within(splat, corner);
            bounds[k] = b.x | b.y << BITS | b.z << 2 * BITS | b.w << 3 * BITS | strips_of(b) << 4 * BITS;
        }
    }
    for (uint begin = first, end; begin < stop; begin = end) {
        uint tile = tile_keys[begin];
        uvec2 range = ranges[tile], corner = TILE * uvec2(tile % wide, tile / wide);
        end = min(stop, range.y);
        uint used = clamp(tile_ends[tile], begin, end);
        for (uint k = thread; k < SQUARES * (end - used); k += THREADS) {
            partials[SQUARES * tile_instances[used + k / SQUARES] + k % SQUARES] = 0.0;
        }
        if (used == begin) continue;

        float left[PIXELS], behind[PIXELS];
        uint last[PIXELS];
        barrier();
        for (uint p = 0; p < PIXELS; ++p) {
            uint k = p * THREADS + thread;
            uvec2 pixel = corner + uvec2(k % TILE, k / TILE);
            left[p] = 1.0;
            behind[p] = 0.0;
            last[p] = 0;
            if (pixel.x < camera.width && pixel.y < camera.height) {
                uint texel = pixel.y * camera.width + pixel.x;
                last[p] = ends[texel];
                behind[p] = dot(picture[texel].xyz, vec3(1.0));
                if (begin > range.x) {
                    vec4 state = checkpoints[begin / BLOCK * TILE_PIXELS + k];
                    behind[p] -= dot(state.xyz, vec3(1.0));
                    left[p] = state.w;
                }
            }
        }
        for (uint base = begin; base < used; base += SPLATS) {
            uint from = base - first;
            for (uint s = 0; s < SPLATS; ++s) {
                uint instance = min(from + s, BLOCK - 1);
                vec4 place = places[instance], other = others[instance];
                vec3 form = vec3(place.w, other.xy);
                uint reached = bounds[instance] >> 4 * BITS;
                for (uint p = 0; p < PIXELS; ++p) {
                    uint k = p * THREADS + thread;
                    if ((reached >> k / STRIP & 1) == 0) continue;
                    float power = log_alpha(vec2(k % TILE, k / TILE) - place.xy, form, place.z);
                    float full = exp2(power), alpha = min(MAX_ALPHA, full), weight = 0.0, slope = 0.0;
                    if (base + s < last[p] && power >= MIN_LOG_ALPHA) {
                        weight = left[p] * alpha;
                        behind[p] -= weight * other.z;
                        if (full <= MAX_ALPHA) slope = alpha * (left[p] * other.z - behind[p] / (1.0 - alpha));
                        left[p] *= 1.0 - alpha;
                    }
                    weights[s * ROW + k] = weight;
                    slopes[s * ROW + k] = slope;
                }
            }
            barrier();
            for (uint item = thread; item < SPLATS * TILE; item += THREADS) {
                uint s = item % SPLATS, k = min(from + s, stop - first - 1);
                square_column(s, k, item / SPLATS, instance_splats[tile_instances[first + k]]);
            }
            barrier();
            for (uint item = thread; item < SQUARES * SPLATS; item += THREADS) {
                uint s = item / SQUARES, value = item % SQUARES;
                if (base + s >= used) continue;
                float sum = 0.0;
                [[unroll]] for (uint column = 0; column < TILE; ++column) sum += sums[(value * SPLATS + s) * TILE + column];
                partials[SQUARES * tile_instances[base + s] + value] = sum;
            }
        }
        barrier();
    }
}
