#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Loss, 1: L1 and SSIM of a rendered picture against a photo, and the derivatives of SSIM by the windowed means, which
// `photo_gradient` carries back to the pixels. A workgroup per tile of 16 x 16 pixels; the window's two passes go through
// shared memory, channel by channel.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
layout(local_size_x = 256, local_size_x_id = 1) in;
#include "splats/photo.glsl"

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Picture { vec4 picture[]; };
layout(binding = 2, std430) readonly buffer Photo { uint photo[]; };
// Planes of a value per pixel, three for each channel: dS/dE[x], dS/dE[xx], dS/dE[xy].
layout(binding = 3, std430) writeonly buffer Slopes { float slopes[]; };
// Of each tile: sums of |x - y|, of SSIM and of (x - y)^2 over pixels and channels.
layout(binding = 4, std430) writeonly buffer TileLosses { vec4 tile_losses[]; };

shared vec2 values[HALO * HALO];  // x and y
shared vec4 rows[HALO * TILE];  // E[x], E[y], E[xx], E[yy] along a row
shared float products[HALO * TILE];  // E[xy]
shared vec4 sums[TILE_PIXELS];

void main() {
    View camera = views[view];
    uvec2 size = uvec2(camera.width, camera.height), tiles = tiles_of(camera);
    uint tile = group_index(), thread = gl_LocalInvocationIndex;
    if (tile >= tiles.x * tiles.y) return;
    uvec2 corner = TILE * uvec2(tile % tiles.x, tile / tiles.x), local = uvec2(thread % TILE, thread / TILE * RUN);
    vec4 sum[RUN];
    [[unroll]] for (uint r = 0; r < RUN; ++r) sum[r] = vec4(0.0);
    for (uint c = 0; c < 3; ++c) {
        barrier();
        for (uint k = thread; k < HALO * HALO; k += THREADS) {
            ivec2 at = ivec2(corner) + ivec2(k % HALO, k / HALO) - RADIUS;
            values[k] = vec2(0.0);
            if (all(greaterThanEqual(at, ivec2(0))) && all(lessThan(uvec2(at), size))) {
                uint texel = uint(at.y) * size.x + uint(at.x);
                if (photo[texel] != UNKNOWN) values[k] = vec2(picture[texel][c], over(photo[texel], background)[c]);
            }
        }
        barrier();
        for (uint k = thread; k < HALO * RUNS; k += THREADS) {
            uint row = k / RUNS, first = k % RUNS * RUN;
            vec2 v[REACH];
            [[unroll]] for (uint i = 0; i < REACH; ++i) v[i] = values[row * HALO + first + i];
            [[unroll]] for (uint r = 0; r < RUN; ++r) {
                vec4 mean = vec4(0.0);
                float product = 0.0;
                [[unroll]] for (uint i = 0; i < 2 * RADIUS + 1; ++i) {
                    mean += WINDOW[i] * vec4(v[r + i], v[r + i] * v[r + i]);
                    product += WINDOW[i] * v[r + i].x * v[r + i].y;
                }
                rows[row * TILE + first + r] = mean;
                products[row * TILE + first + r] = product;
            }
        }
        barrier();
        vec4 along[REACH];
        float product_along[REACH];
        [[unroll]] for (uint i = 0; i < REACH; ++i) {
            along[i] = rows[(local.y + i) * TILE + local.x];
            product_along[i] = products[(local.y + i) * TILE + local.x];
        }
        [[unroll]] for (uint r = 0; r < RUN; ++r) {
            uvec2 pixel = corner + local + uvec2(0, r);
            if (any(greaterThanEqual(pixel, size))) continue;
            vec4 mean = vec4(0.0);
            float product = 0.0;
            [[unroll]] for (uint i = 0; i < 2 * RADIUS + 1; ++i) {
                mean += WINDOW[i] * along[r + i];
                product += WINDOW[i] * product_along[r + i];
            }
            vec2 variance = mean.zw - mean.xy * mean.xy;
            float covariance = product - mean.x * mean.y;
            float a = 2.0 * mean.x * mean.y + C1, b = 2.0 * covariance + C2;
            float d = dot(mean.xy, mean.xy) + C1, e = variance.x + variance.y + C2;
            float ssim = a * b / (d * e);
            float by_variance = -ssim / e, by_covariance = 2.0 * a / (d * e);
            float by_mean = 2.0 * mean.y * b / (d * e) - 2.0 * mean.x * ssim / d - 2.0 * mean.x * by_variance
                - mean.y * by_covariance;
            uint plane = size.x * size.y, texel = pixel.y * size.x + pixel.x;
            slopes[(3 * c + 0) * plane + texel] = by_mean;
            slopes[(3 * c + 1) * plane + texel] = by_variance;
            slopes[(3 * c + 2) * plane + texel] = by_covariance;
            vec2 mine = values[(local.y + r + RADIUS) * HALO + local.x + RADIUS];
            float difference = mine.x - mine.y;
            sum[r] += vec4(abs(difference), ssim, difference * difference, 0.0);
        }
    }
    [[unroll]] for (uint r = 0; r < RUN; ++r) sums[(local.y + r) * TILE + local.x] = sum[r];
    for (uint half_ = TILE_PIXELS / 2; half_ > 0; half_ >>= 1) {
        barrier();
        for (uint k = thread; k < half_; k += THREADS) sums[k] += sums[k + half_];
    }
    if (thread == 0) tile_losses[tile] = sums[0];
}
