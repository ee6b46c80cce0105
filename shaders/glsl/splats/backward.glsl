// The gradient of the loss by what each instance brings to its tile. A workgroup takes BLOCK instances of the sorted list,
// whatever tiles they belong to, so that no tile is longer work than another; within a tile it continues from the checkpoint that
// the forward pass left.
//
// A workgroup is the lanes of a block (splats/blocks.glsl). Each has a pixel of every block of the tile in registers, and
// goes through the instances front to back, block by block where they reach; then the lanes add up their sums, in an order that
// depends on their number alone. No thread waits for another but for that, and shared memory holds LANES instances: it would
// limit how many workgroups a multiprocessor has, as registers do.
//
// With x = sum_j c_j a_j T_j + T_end * background and g = dL/dx:
// dL/da_k = T_k c_k.g - (x.g - sum_{j <= k} c_j.g a_j T_j)/(1 - a_k).
//
// Included after the push constants, splats/blocks.glsl and `void leave(uint instance, uint value, float sum)`, which takes the
// sums of an instance, by its place in the order of emission.

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

// Whether to step over blocks that an instance does not reach: CPUs do the work of both sides of a branch, and then choose.
const bool SKIPS = LANES > WIDE;

// An instance that a lane has brought for all.
struct Held {
    vec4 place;  // mean from the centre of the tile's first pixel, logarithm of the opacity, blue
    vec4 form;  // form of the exponent, red
    float green;
    uint blocks;  // that it reaches
    uint instance;  // place in the order of emission
    uint spare;
};
shared Held held[LANES];
// Values that lanes exchange at a time, at most.
const uint MOST = 5;
shared float exchanged[SUBGROUPS ? 1 : MOST * LANES];

// The first `count` values of the lane whose number differs by `apart`, a power of two.
float[MOST] across(float values[MOST], uint count, uint lane, uint apart) {
    if (!SUBGROUPS) {
        barrier();
        [[unroll]] for (uint i = 0; i < MOST; ++i) {
            if (i < count) exchanged[i * LANES + lane] = values[i];
        }
        barrier();
    }
    float others[MOST];
    [[unroll]] for (uint i = 0; i < MOST; ++i) {
        others[i] = 0.0;
        if (i >= count) continue;
        if (SUBGROUPS) others[i] = subgroupShuffleXor(values[i], apart);
        else others[i] = exchanged[i * LANES + (lane ^ apart)];
    }
    return others;
}

// Adds up what lanes have and hands the sums to `leave`. Eight of the values are halved thrice: of a pair of lanes each keeps one
// half and adds the other's, so that then every lane has one value. The ninth all lanes add up.
void leave_sums(float sums[SUMS], uint lane, uint instance) {
    vec4 low = vec4(sums[0], sums[1], sums[2], sums[3]), high = vec4(sums[4], sums[5], sums[6], sums[7]);
    float ninth = sums[8];
    bool upper = (lane & 1) != 0;
    vec4 four = upper ? low : high;
    float others[MOST] = across(float[](four.x, four.y, four.z, four.w, ninth), 5, lane, 1);
    four = (upper ? high : low) + vec4(others[0], others[1], others[2], others[3]);
    ninth += others[4];
    upper = (lane & 2) != 0;
    vec2 two = upper ? four.xy : four.zw;
    others = across(float[](two.x, two.y, ninth, 0.0, 0.0), 3, lane, 2);
    two = (upper ? four.zw : four.xy) + vec2(others[0], others[1]);
    ninth += others[2];
    upper = (lane & 4) != 0;
    others = across(float[](upper ? two.x : two.y, ninth, 0.0, 0.0, 0.0), 2, lane, 4);
    float one = (upper ? two.y : two.x) + others[0];
    ninth += others[1];
    [[unroll]] for (uint apart = 8; apart < LANES; apart *= 2) {
        others = across(float[](one, ninth, 0.0, 0.0, 0.0), 2, lane, apart);
        one += others[0];
        ninth += others[1];
    }
    if (lane < 8) leave(instance, (lane & 1) << 2 | lane & 2 | lane >> 2, one);
    if (lane == LANES - 1) leave(instance, 8, ninth);
}

void main() {
    View camera = views[view];
    uint lane = numbered(), first = group_index() * BLOCK;
    uint stop = min(first + BLOCK, min(counts[0], capacity));
    if (first >= stop) return;
    uint wide = tiles_of(camera).x;
    for (uint begin = first, end; begin < stop; begin = end) {
        uint tile = tile_keys[begin];
        uvec2 range = ranges[tile], corner = TILE * uvec2(tile % wide, tile / wide);
        end = min(stop, range.y);
        uint used = clamp(tile_ends[tile], begin, end);
        for (uint k = lane; k < SUMS * (end - used); k += LANES) leave(tile_instances[used + k / SUMS], k % SUMS, 0.0);
        if (used == begin) continue;

        // Of each pixel g, times what is left of the light and times what is still to come from behind; and where it ends.
        vec3 gradient[BLOCKS];
        float behind[BLOCKS];
        uint last[BLOCKS];
        [[unroll]] for (uint b = 0; b < BLOCKS; ++b) {
            uvec2 local = pixel_in(b, lane), pixel = corner + local;
            gradient[b] = vec3(0.0);
            behind[b] = 0.0;
            last[b] = 0;
            if (pixel.x < camera.width && pixel.y < camera.height) {
                uint texel = pixel.y * camera.width + pixel.x;
                vec3 colour = picture[texel].xyz, g = by_pixel[texel].xyz;
                float left = 1.0;
                if (begin > range.x) {
                    vec4 state = checkpoints[begin / BLOCK * TILE_PIXELS + local.y * TILE + local.x];
                    colour -= state.xyz;
                    left = state.w;
                }
                gradient[b] = left * g;
                behind[b] = dot(g, colour);
                last[b] = ends[texel];
            }
        }
        for (uint from = begin; from < used; from += LANES) {
            barrier();
            if (from + lane < used) {
                uint instance = tile_instances[from + lane];
                Projected splat = projected[instance_splats[instance]];
                held[lane] = Held(
                    vec4(splat.mean - vec2(corner) - 0.5, log2(splat.opacity), splat.colour.z),
                    vec4(form_of(splat), splat.colour.x), splat.colour.y,
                    blocks_of(bounds_within(splat, corner)), instance, 0
                );
            }
            barrier();
            for (uint k = 0; k < min(used - from, LANES); ++k) {
                Held splat = held[k];
                vec3 colour = vec3(splat.form.w, splat.green, splat.place.w);
                // By colour; and of q, q dy, q dy^2 in each of the two columns in which the lane has pixels.
                vec3 by_colour = vec3(0.0), by_column[2] = vec3[](vec3(0.0), vec3(0.0));
                [[unroll]] for (uint b = 0; b < BLOCKS; ++b) {
                    if (SKIPS && (splat.blocks >> b & 1) == 0) continue;
                    vec2 d = vec2(pixel_in(b, lane)) - splat.place.xy;
                    float power = log_alpha(d, splat.form.xyz, splat.place.z);
                    bool counts = from + k < last[b] && power >= MIN_LOG_ALPHA;
                    float full = counts ? exp2(power) : 0.0, alpha = min(MAX_ALPHA, full);
                    float shade = dot(gradient[b], colour);
                    behind[b] -= alpha * shade;
                    float by_alpha = shade - behind[b] / (1.0 - alpha);
                    // Where the cap holds, the parameters do not show in alpha.
                    float q = full <= MAX_ALPHA ? by_alpha * alpha : 0.0;
                    by_colour += alpha * gradient[b];
                    gradient[b] *= 1.0 - alpha;
                    by_column[b % 2] += q * vec3(1.0, d.y, d.y * d.y);
                }
                vec2 x = vec2(pixel_in(0, lane).x, pixel_in(1, lane).x) - splat.place.x;
                vec3 q = by_column[0] + by_column[1];
                vec2 qx = x.x * by_column[0].xy + x.y * by_column[1].xy;
                float qxx = x.x * x.x * by_column[0].x + x.y * x.y * by_column[1].x;
                float sums[SUMS] = float[](by_colour.x, by_colour.y, by_colour.z, q.x, qx.x, q.y, qxx, qx.y, q.z);
                leave_sums(sums, lane, splat.instance);
            }
        }
    }
}
