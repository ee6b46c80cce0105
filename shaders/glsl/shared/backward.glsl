// The gradient of the loss by what each instance brings to its tile. A workgroup takes BLOCK instances of the sorted list,
// whatever tiles they belong to, so that no tile is longer work than another; within a tile it goes on from the checkpoint that
// the forward pass left.
//
// SPLATS instances at a time: first pixel by pixel, front to back, what each pixel says to each instance, into shared memory;
// then instance by instance the sums over the pixels in its bounds, each in fixed order.
//
// With x = sum_j c_j a_j T_j + T_end * background and g = dL/dx: dL/da_k = T_k c_k.g - (x.g - sum_{j <= k} c_j.g a_j T_j)/(1 - a_k).
//
// Included after the push constants and `void leave(uint instance, uint value, float sum)`, which takes the sums of an instance,
// by its place in the order of emission.

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 2, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 4, std430) readonly buffer TileKeys { uint tile_keys[]; };
layout(binding = 5, std430) readonly buffer TileInstances { uint tile_instances[]; };
layout(binding = 6, std430) readonly buffer Ranges { uvec2 ranges[]; };
layout(binding = 7, std430) readonly buffer Picture { vec4 picture[]; };
layout(binding = 8, std430) readonly buffer Ends { uint ends[]; };
layout(binding = 9, std430) readonly buffer TileEnds { uint tile_ends[]; };
layout(binding = 10, std430) readonly buffer Checkpoints { vec4 checkpoints[]; };
// dL/dx of each pixel.
layout(binding = 11, std430) readonly buffer ByPixel { vec4 by_pixel[]; };

const uint THREADS = gl_WorkGroupSize.x;
const uint PIXELS = TILE_PIXELS / THREADS;
const uint SPLATS = 8;
// Pixels of a splat's row in shared memory, with what keeps rows out of one another's banks.
const uint ROW = TILE_PIXELS + 4;
// Parts that a sum over pixels is made of: every so many columns.
const uint PARTS = 8;

// 32 KiB is all that some devices have: no vec3, which may take as much as a vec4.
shared vec4 means[BLOCK];  // mean, opacity, conic xx
shared vec4 conics[BLOCK];  // conic xy and yy, red, green
shared float blues[BLOCK];
// Bounds within the instance's tile, five bits each, and above them its strips.
shared uint bounds[BLOCK];
shared float weights[SPLATS * ROW];
shared float slopes[SPLATS * ROW];
shared float by_colour[3 * TILE_PIXELS];
shared float sums[SUMS * SPLATS * PARTS];

// Pixel `k` of the tile at `corner`, from its centre.
vec2 pixel_centre(uvec2 corner, uint k) {
    return vec2(corner + uvec2(k % TILE, k / TILE)) + 0.5;
}

const uint BITS = 5;

uint packed(uvec4 b) {
    return b.x | b.y << BITS | b.z << 2 * BITS | b.w << 3 * BITS | strips_of(b) << 4 * BITS;
}

// First pixel in x and y, and one past the last.
uvec4 unpacked(uint b) {
    return uvec4(b, b >> BITS, b >> 2 * BITS, b >> 3 * BITS) & ((1u << BITS) - 1);
}

// Sums over a part of the pixels: of a splat's colour, or of its shape.
void sum_part(uint item, uint from, uvec2 corner) {
    uint s = item % SPLATS, part = item / SPLATS % PARTS, k = min(from + s, BLOCK - 1);
    uvec4 inside = unpacked(bounds[k]);
    vec3 sum = vec3(0.0), more = vec3(0.0);
    bool of_colour = item < SPLATS * PARTS;
    // Two loops, of which one is empty: some devices walk through both sides of a branch.
    for (uint y = inside.y; y < (of_colour ? inside.w : 0); ++y) {
        for (uint x = inside.x + part; x < inside.z; x += PARTS) {
            uint j = y * TILE + x;
            vec3 gradient = vec3(by_colour[j], by_colour[TILE_PIXELS + j], by_colour[2 * TILE_PIXELS + j]);
            sum += weights[s * ROW + j] * gradient;
        }
    }
    vec2 origin = vec2(corner) + 0.5 - means[k].xy;
    for (uint y = inside.y; y < (of_colour ? 0 : inside.w); ++y) {
        for (uint x = inside.x + part; x < inside.z; x += PARTS) {
            vec2 d = origin + vec2(x, y);
            float q = slopes[s * ROW + y * TILE + x];
            sum += q * vec3(1.0, d);
            more += q * vec3(d.x * d.x, d.x * d.y, d.y * d.y);
        }
    }
    uint first = of_colour ? 0 : 3;
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        sums[((first + c) * SPLATS + s) * PARTS + part] = sum[c];
        if (!of_colour) sums[((6 + c) * SPLATS + s) * PARTS + part] = more[c];
    }
}

void main() {
    View camera = views[view];
    uint thread = gl_LocalInvocationIndex, first = group_index() * BLOCK;
    uint stop = min(first + BLOCK, min(counts[0], room));
    if (first >= stop) return;
    uint wide = tiles_of(camera).x;
    for (uint k = thread; k < BLOCK; k += THREADS) {
        means[k] = conics[k] = vec4(0.0);
        blues[k] = 0.0;
        bounds[k] = 0;
        if (first + k < stop) {
            Projected splat = projected[instance_splats[tile_instances[first + k]]];
            means[k] = vec4(splat.mean, splat.opacity, splat.conic.x);
            conics[k] = vec4(splat.conic.yz, splat.colour.xy);
            blues[k] = splat.colour.z;
            uint tile = tile_keys[first + k];
            bounds[k] = packed(bounds_within(splat, TILE * uvec2(tile % wide, tile / wide)));
        }
    }
    for (uint begin = first, end; begin < stop; begin = end) {
        uint tile = tile_keys[begin];
        uvec2 range = ranges[tile], corner = TILE * uvec2(tile % wide, tile / wide);
        end = min(stop, range.y);
        uint used = clamp(tile_ends[tile], begin, end);
        for (uint k = thread; k < SUMS * (end - used); k += THREADS) leave(tile_instances[used + k / SUMS], k % SUMS, 0.0);
        if (used == begin) continue;

        vec3 gradient[PIXELS];
        float left[PIXELS], passed[PIXELS], all[PIXELS];
        uint last[PIXELS];
        barrier();
        for (uint p = 0; p < PIXELS; ++p) {
            uint k = p * THREADS + thread;
            uvec2 pixel = corner + uvec2(k % TILE, k / TILE);
            gradient[p] = vec3(0.0);
            left[p] = 1.0;
            passed[p] = all[p] = 0.0;
            last[p] = 0;
            if (pixel.x < camera.width && pixel.y < camera.height) {
                uint texel = pixel.y * camera.width + pixel.x;
                gradient[p] = by_pixel[texel].xyz;
                last[p] = ends[texel];
                all[p] = dot(gradient[p], picture[texel].xyz);
                if (begin > range.x) {
                    vec4 state = checkpoints[begin / BLOCK * TILE_PIXELS + k];
                    passed[p] = dot(gradient[p], state.xyz);
                    left[p] = state.w;
                }
            }
            [[unroll]] for (uint c = 0; c < 3; ++c) by_colour[c * TILE_PIXELS + k] = gradient[p][c];
        }
        barrier();
        for (uint base = begin; base < used; base += SPLATS) {
            uint from = base - first;
            for (uint s = 0; s < SPLATS; ++s) {
                uint instance = min(from + s, BLOCK - 1);
                vec4 mean = means[instance], other = conics[instance];
                vec3 conic = vec3(mean.w, other.xy), colour = vec3(other.zw, blues[instance]);
                uint reached = bounds[instance] >> 4 * BITS;
                [[unroll]] for (uint p = 0; p < PIXELS; ++p) {
                    uint k = p * THREADS + thread;
                    if ((reached >> k / STRIP & 1) == 0) continue;
                    vec2 d = pixel_centre(corner, k) - mean.xy;
                    float sigma = 0.5 * (conic.x * d.x * d.x + conic.z * d.y * d.y) + conic.y * d.x * d.y;
                    float full = mean.z * exp(-sigma), alpha = min(MOST_ALPHA, full);
                    float weight = 0.0, slope = 0.0;
                    if (base + s < last[p] && sigma >= 0.0 && alpha >= LEAST_ALPHA) {
                        float shade = dot(gradient[p], colour);
                        weight = left[p] * alpha;
                        passed[p] += weight * shade;
                        float by_alpha = left[p] * shade - (all[p] - passed[p]) / (1.0 - alpha);
                        slope = full <= MOST_ALPHA ? by_alpha * alpha : 0.0;
                        left[p] *= 1.0 - alpha;
                    }
                    weights[s * ROW + k] = weight;
                    slopes[s * ROW + k] = slope;
                }
            }
            barrier();
            for (uint item = thread; item < 2 * SPLATS * PARTS; item += THREADS) sum_part(item, from, corner);
            barrier();
            for (uint item = thread; item < SUMS * SPLATS; item += THREADS) {
                uint s = item / SUMS, value = item % SUMS;
                if (base + s >= used) continue;
                float sum = 0.0;
                [[unroll]] for (uint part = 0; part < PARTS; ++part) sum += sums[(value * SPLATS + s) * PARTS + part];
                leave(tile_instances[base + s], value, sum);
            }
        }
    }
}
