#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Loss, 2: its gradient by each pixel of the picture, 0.8 mean |x - y| + 0.2 (1 - mean SSIM). The window is symmetric, so that
// what `photo_ssim` found for each window goes back through the same two passes.
#include "shared/group.glsl"
#include "shared/gaussian.glsl"
#include "shared/frame.glsl"
#include "shared/photo.glsl"
layout(local_size_x = 256) in;

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
    uvec2 corner = TILE * uvec2(tile % tiles.x, tile / tiles.x), local = uvec2(thread % TILE, thread / TILE);
    uvec2 pixel = corner + local;
    bool inside = all(lessThan(pixel, size));
    uint plane = size.x * size.y, mine = pixel.y * size.x + pixel.x;
    bool known = inside && photo[inside ? mine : 0] != UNKNOWN;
    vec3 x = known ? picture[mine].xyz : vec3(0.0), y = known ? over(photo[mine], background) : vec3(0.0);
    vec3 gradient = vec3(0.0);
    for (uint c = 0; c < 3; ++c) {
        barrier();
        for (uint k = thread; k < HALO * HALO; k += 256) {
            ivec2 at = ivec2(corner) + ivec2(k % HALO, k / HALO) - RADIUS;
            values[k] = vec3(0.0);
            if (all(greaterThanEqual(at, ivec2(0))) && all(lessThan(uvec2(at), size))) {
                uint texel = 3 * c * plane + uint(at.y) * size.x + uint(at.x);
                values[k] = vec3(slopes[texel], slopes[texel + plane], slopes[texel + 2 * plane]);
            }
        }
        barrier();
        for (uint k = thread; k < HALO * TILE; k += 256) {
            uint start = k / TILE * HALO + k % TILE;
            vec3 row = vec3(0.0);
            [[unroll]] for (uint i = 0; i < 2 * RADIUS + 1; ++i) row += WINDOW[i] * values[start + i];
            rows[k] = row;
        }
        barrier();
        vec3 sum = vec3(0.0);
        [[unroll]] for (uint i = 0; i < 2 * RADIUS + 1; ++i) sum += WINDOW[i] * rows[(local.y + i) * TILE + local.x];
        float by_ssim = sum.x + 2.0 * x[c] * sum.y + y[c] * sum.z;
        gradient[c] = L1_SHARE * sign(x[c] - y[c]) - (1.0 - L1_SHARE) * by_ssim;
    }
    if (inside) by_pixel[mine] = vec4(known ? gradient / float(3 * plane) : vec3(0.0), 0.0);
}
