// The gradient of the loss by what each instance brings to its tile. A workgroup takes BLOCK instances of the sorted list,
// whatever tiles they belong to, so that no tile is longer work than another; within a tile it continues from the checkpoint that
// the forward pass left.
//
// SPLATS instances at a time: what each pixel contributes to each instance, front to back, and the sums over the pixels of a
// lane, strip by strip; then the sums over lanes, in fixed order. On a GPU a thread has a pixel, and pixels' contributions go
// through shared memory to the threads that have lanes. On a CPU, where each access to shared memory takes longer than what it
// brings, few threads have many pixels (NARROW), all those of a lane of their own.
//
// With x = sum_j c_j a_j T_j + T_end * background and g = dL/dx:
// dL/da_k = T_k c_k.g - (x.g - sum_{j <= k} c_j.g a_j T_j)/(1 - a_k).
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
// A thread has many pixels, those of its lane, or one.
const bool NARROW = THREADS <= STRIP;
// Instances in shared memory, and of these worked on at a time. More of them run slower: shared memory limits how many
// workgroups a multiprocessor holds.
const uint STAGED = 64;
const uint SPLATS = 4;
// Sums over a tile's pixels are made by lanes, which take COLUMNS pixels of every strip, always in the same columns.
const uint LANES = NARROW ? THREADS : STRIP;
const uint COLUMNS = STRIP / LANES;
const uint STRIPS = TILE_PIXELS / STRIP;
// Sums of an instance over lanes are made in parts, of eleven lanes at most.
const uint PARTS = (LANES + 10) / 11;
const uint PART = (LANES + PARTS - 1) / PARTS;
const uint ROWS = SUMS * SPLATS;
// Lanes of a row in shared memory, with what keeps rows out of one another's banks.
const uint ROW = LANES + 1;

// No vec3, which some devices pad to a vec4.
shared vec4 means[STAGED];  // mean, opacity, conic xx
shared vec4 conics[STAGED];  // conic xy and yy, red, green
shared float blues[STAGED];
shared uint strips[STAGED];
// What each pixel contributes to each instance.
shared vec2 said[NARROW ? 1 : SPLATS * TILE_PIXELS];
shared float by_lane[ROWS * ROW];
shared float by_part[ROWS * PARTS];

// Pixel `k` of the tile at `corner`.
uvec2 pixel_of(uvec2 corner, uint k) {
    return corner + uvec2(k % TILE, k / TILE);
}

// Brings instances `from` to `end` of a tile to shared memory.
void stage(uint from, uint end, uvec2 corner) {
    for (uint k = gl_LocalInvocationIndex; k < STAGED; k += THREADS) {
        means[k] = conics[k] = vec4(0.0);
        blues[k] = 0.0;
        strips[k] = 0;
        if (from + k >= end) continue;
        Projected splat = projected[instance_splats[tile_instances[from + k]]];
        means[k] = vec4(splat.mean, splat.opacity, splat.conic.x);
        conics[k] = vec4(splat.conic.yz, splat.colour.xy);
        blues[k] = splat.colour.z;
        strips[k] = strips_of(bounds_within(splat, corner));
    }
}

// What a pixel contributes to an instance: the weight of its colour, and dL/da * a. `d` is from the instance's mean to the pixel;
// `counts`: whether the pixel's light gets this far. Updates `left`, the remaining light, and `behind`, the gradient by what is
// still to come.
vec2 say(vec2 d, vec4 mean, vec4 other, float blue, bool counts, vec3 gradient, inout float left, inout float behind) {
    vec3 conic = vec3(mean.w, other.xy), colour = vec3(other.zw, blue);
    float sigma = 0.5 * (conic.x * d.x * d.x + conic.z * d.y * d.y) + conic.y * d.x * d.y;
    float full = mean.z * exp(-sigma), alpha = min(MAX_ALPHA, full);
    float weight = 0.0, slope = 0.0;
    if (counts && sigma >= 0.0 && alpha >= MIN_ALPHA) {
        float shade = dot(gradient, colour);
        weight = left * alpha;
        behind -= weight * shade;
        float by_alpha = left * shade - behind / (1.0 - alpha);
        slope = full <= MAX_ALPHA ? by_alpha * alpha : 0.0;
        left *= 1.0 - alpha;
    }
    return vec2(weight, slope);
}

// Sums over pixels of one column: by colour, and of q, q dy, q dy^2.
struct Column {
    vec3 colour;
    vec3 q;
};

void add(inout Column sum, vec2 pixel, float y, vec3 gradient) {
    sum.colour += pixel.x * gradient;
    sum.q += pixel.y * vec3(1.0, y, y * y);
}

// The same for a column at `x` from the mean, in the order of SUMS.
float[SUMS] sums_of(Column sum, float x) {
    vec3 colour = sum.colour, q = sum.q;
    return float[SUMS](colour.x, colour.y, colour.z, q.x, x * q.x, q.y, x * x * q.x, x * q.y, q.z);
}

void keep(uint s, uint lane, float sums[SUMS]) {
    [[unroll]] for (uint value = 0; value < SUMS; ++value) by_lane[(value * SPLATS + s) * ROW + lane] = sums[value];
}

// Sums over a lane's pixels of what they contribute to the `s`-th instance worked on, which is the `k`-th in shared memory. `centre`
// is that of the lane's first pixel.
void sum_lane(uint k, uint s, uint lane, vec2 centre, vec3 gradients[STRIPS]) {
    Column sum = Column(vec3(0.0), vec3(0.0));
    vec2 d = centre - means[k].xy;
    uint reached = strips[k];
    [[unroll]] for (uint strip = 0; strip < STRIPS; ++strip) {
        if ((reached >> strip & 1) == 0) continue;
        add(sum, said[s * TILE_PIXELS + strip * STRIP + lane], d.y + float(strip * (STRIP / TILE)), gradients[strip]);
    }
    keep(s, lane, sums_of(sum, d.x));
}

// Sums over a part of the lanes.
void sum_part(uint item) {
    uint row = item % ROWS, part = item / ROWS;
    float sum = 0.0;
    [[unroll]] for (uint i = 0; i < PART; ++i) {
        uint lane = part * PART + i;
        if (lane < LANES) sum += by_lane[row * ROW + lane];
    }
    by_part[item] = sum;
}

void main() {
    View camera = views[view];
    uint thread = gl_LocalInvocationIndex, first = group_index() * BLOCK;
    uint stop = min(first + BLOCK, min(counts[0], room));
    if (first >= stop) return;
    uint wide = tiles_of(camera).x, lane = thread % LANES;
    for (uint begin = first, end; begin < stop; begin = end) {
        uint tile = tile_keys[begin];
        uvec2 range = ranges[tile], corner = TILE * uvec2(tile % wide, tile / wide);
        end = min(stop, range.y);
        uint used = clamp(tile_ends[tile], begin, end);
        for (uint k = thread; k < SUMS * (end - used); k += THREADS) leave(tile_instances[used + k / SUMS], k % SUMS, 0.0);
        if (used == begin) continue;

        // Of each pixel: what is left of the light, and the gradient by what is still to come from behind.
        vec3 gradient[PIXELS];
        float left[PIXELS], behind[PIXELS];
        uint last[PIXELS];
        [[unroll]] for (uint p = 0; p < PIXELS; ++p) {
            uint k = p * THREADS + thread;
            uvec2 pixel = pixel_of(corner, k);
            gradient[p] = vec3(0.0);
            left[p] = 1.0;
            behind[p] = 0.0;
            last[p] = 0;
            if (pixel.x < camera.width && pixel.y < camera.height) {
                uint texel = pixel.y * camera.width + pixel.x;
                vec3 colour = picture[texel].xyz;
                if (begin > range.x) {
                    vec4 state = checkpoints[begin / BLOCK * TILE_PIXELS + k];
                    colour -= state.xyz;
                    left[p] = state.w;
                }
                gradient[p] = by_pixel[texel].xyz;
                behind[p] = dot(gradient[p], colour);
                last[p] = ends[texel];
            }
        }
        // By the pixels of the thread's lane, for `sum_lane`.
        vec3 gradients[STRIPS];
        [[unroll]] for (uint strip = 0; strip < STRIPS; ++strip) {
            uvec2 pixel = pixel_of(corner, strip * STRIP + lane);
            bool inside = pixel.x < camera.width && pixel.y < camera.height;
            gradients[strip] = inside ? by_pixel[pixel.y * camera.width + pixel.x].xyz : vec3(0.0);
        }
        for (uint from = begin; from < used; from += STAGED) {
            uint here = min(used - from, STAGED);
            barrier();
            stage(from, used, corner);
            barrier();
            for (uint base = 0; base < here; base += SPLATS) {
                for (uint s = 0; s < SPLATS; ++s) {
                    uint k = base + s, reached = strips[k];
                    // What does not reach the thread's strip is not even loaded.
                    if (!NARROW && (reached >> thread / STRIP & 1) == 0) continue;
                    vec4 mean = means[k], other = conics[k];
                    float blue = blues[k];
                    if (!NARROW) {
                        vec2 d = vec2(pixel_of(corner, thread)) + 0.5 - mean.xy;
                        bool counts = from + k < last[0];
                        said[s * TILE_PIXELS + thread] = say(d, mean, other, blue, counts, gradient[0], left[0], behind[0]);
                        continue;
                    }
                    float sums[SUMS];
                    [[unroll]] for (uint value = 0; value < SUMS; ++value) sums[value] = 0.0;
                    [[unroll]] for (uint c = 0; c < COLUMNS; ++c) {
                        Column sum = Column(vec3(0.0), vec3(0.0));
                        uint column = c * THREADS + thread;
                        [[unroll]] for (uint strip = 0; strip < STRIPS; ++strip) {
                            if ((reached >> strip & 1) == 0) continue;
                            uint p = strip * COLUMNS + c;
                            vec2 d = vec2(pixel_of(corner, strip * STRIP + column)) + 0.5 - mean.xy;
                            bool counts = from + k < last[p];
                            add(sum, say(d, mean, other, blue, counts, gradient[p], left[p], behind[p]), d.y, gradient[p]);
                        }
                        float of_column[SUMS] = sums_of(sum, float(pixel_of(corner, column).x) + 0.5 - mean.x);
                        [[unroll]] for (uint value = 0; value < SUMS; ++value) sums[value] += of_column[value];
                    }
                    keep(s, thread, sums);
                }
                barrier();
                if (!NARROW) {
                    vec2 centre = vec2(pixel_of(corner, lane)) + 0.5;
                    for (uint s = thread / LANES; s < SPLATS; s += THREADS / LANES) sum_lane(base + s, s, lane, centre, gradients);
                    barrier();
                }
                for (uint item = thread; item < ROWS * PARTS; item += THREADS) sum_part(item);
                barrier();
                for (uint item = thread; item < ROWS; item += THREADS) {
                    uint s = item / SUMS, value = item % SUMS;
                    if (base + s >= here) continue;
                    float sum = 0.0;
                    [[unroll]] for (uint part = 0; part < PARTS; ++part) sum += by_part[part * ROWS + value * SPLATS + s];
                    leave(tile_instances[from + base + s], value, sum);
                }
            }
        }
    }
}
