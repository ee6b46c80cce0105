#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Loss, 2: its gradient by each pixel of the picture, 0.8 mean |x - y| + 0.2 (1 - mean SSIM). The window is symmetric, so that
// what `photo_ssim` found for each window goes back through the same two passes.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
layout(local_size_x = 256, local_size_x_id = 1) in;
#include "splats/photo.glsl"

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Picture { vec4 picture[]; };
layout(binding = 2, std430) readonly buffer Photo { uint photo[]; };
layout(binding = 3, std430) readonly buffer Slopes { float slopes[]; };
layout(binding = 4, std430) writeonly buffer ByPixel { vec4 by_pixel[]; };

shared vec3 values[HALO * HALO];
shared vec3 rows[HALO * TILE];

void main() {
    View camera = views[view];
    uvec2 size = uvec2(camera.width, camera.height), tiles = tiles_of(camera);
    uint tile = group_index(), thread = gl_LocalInvocationIndex;
    if (tile >= tiles.x * tiles.y) return;
    uvec2 corner = TILE * uvec2(tile % tiles.x, tile / tiles.x), local = uvec2(thread % TILE, thread / TILE * RUN);
    uint plane = size.x * size.y;
    vec3 x[RUN], y[RUN], gradient[RUN];
    bool known[RUN];
    [[unroll]] for (uint r = 0; r < RUN; ++r) {
        uvec2 pixel = corner + local + uvec2(0, r);
        bool inside = all(lessThan(pixel, size));
        uint texel = inside ? pixel.y * size.x + pixel.x : 0;
        known[r] = inside && photo[texel] != UNKNOWN;
        x[r] = known[r] ? picture[texel].xyz : vec3(0.0);
        y[r] = known[r] ? over(photo[texel], background) : vec3(0.0);
        gradient[r] = vec3(0.0);
    }
    for (uint c = 0; c < 3; ++c) {
        barrier();
        for (uint k = thread; k < HALO * HALO; k += THREADS) {
            ivec2 at = ivec2(corner) + ivec2(k % HALO, k / HALO) - RADIUS;
            values[k] = vec3(0.0);
            if (all(greaterThanEqual(at, ivec2(0))) && all(lessThan(uvec2(at), size))) {
                uint texel = 3 * c * plane + uint(at.y) * size.x + uint(at.x);
                values[k] = vec3(slopes[texel], slopes[texel + plane], slopes[texel + 2 * plane]);
            }
        }
        barrier();
        for (uint k = thread; k < HALO * RUNS; k += THREADS) {
            uint row = k / RUNS, first = k % RUNS * RUN;
            vec3 v[REACH];
            [[unroll]] for (uint i = 0; i < REACH; ++i) v[i] = values[row * HALO + first + i];
            [[unroll]] for (uint r = 0; r < RUN; ++r) {
                vec3 sum = vec3(0.0);
                [[unroll]] for (uint i = 0; i < 2 * RADIUS + 1; ++i) sum += WINDOW[i] * v[r + i];
                rows[row * TILE + first + r] = sum;
            }
        }
        barrier();
        vec3 along[REACH];
        [[unroll]] for (uint i = 0; i < REACH; ++i) along[i] = rows[(local.y + i) * TILE + local.x];
        [[unroll]] for (uint r = 0; r < RUN; ++r) {
            vec3 sum = vec3(0.0);
            [[unroll]] for (uint i = 0; i < 2 * RADIUS + 1; ++i) sum += WINDOW[i] * along[r + i];
            float by_ssim = sum.x + 2.0 * x[r][c] * sum.y + y[r][c] * sum.z;
            gradient[r][c] = L1_SHARE * sign(x[r][c] - y[r][c]) - (1.0 - L1_SHARE) * by_ssim;
        }
    }
    [[unroll]] for (uint r = 0; r < RUN; ++r) {
        uvec2 pixel = corner + local + uvec2(0, r);
        if (any(greaterThanEqual(pixel, size))) continue;
        by_pixel[pixel.y * size.x + pixel.x] = vec4(known[r] ? gradient[r] / float(3 * plane) : vec3(0.0), 0.0);
    }
}
