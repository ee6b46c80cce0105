#version 450
#extension GL_GOOGLE_include_directive : require
// Loss, 3: the sums of all tiles, in fixed order, into the history that the host reads. Where the iteration had less capacity
// than its instances needed, or its loss is no number, nothing that outlives an iteration is written from here on: the host finds
// everything as it was before.
#include "shared/fold.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
layout(local_size_x = 256) in;

// What an iteration came to: means over pixels and channels of |x - y|, SSIM and (x - y)^2.
struct Record {
    float l1;
    float ssim;
    float squared;
    uint instances;
    uint splats;
};

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 2, std430) readonly buffer TileLosses { vec4 tile_losses[]; };
// [0] not zero: halted.
layout(binding = 3, std430) buffer Control { uint control[]; };
// Host-visible.
layout(binding = 4, std430) writeonly buffer History { Record history[]; };
// Host-visible: [0] iterations done, [1] instances that an iteration needed where capacity was lower, [2] a loss that is no number.
layout(binding = 5, std430) writeonly buffer Mailbox { uint mailbox[]; };

layout(binding = 6, std430) readonly buffer Population { uint population[]; };

shared vec4 sums[256];

void main() {
    View camera = views[view];
    uvec2 tiles = tiles_of(camera);
    uint thread = gl_LocalInvocationIndex, count = tiles.x * tiles.y;
    vec4 sum = vec4(0.0);
    for (uint tile = thread; tile < count; tile += 256) sum += tile_losses[tile];
    sums[thread] = sum;
    FOLD(thread, 256, sums[thread] += sums[thread + apart]);
    if (thread != 0 || control[0] != 0) return;
    vec3 means = sums[0].xyz / float(3 * camera.width * camera.height);
    bool crowded = counts[0] > capacity, finite = all(lessThan(floatBitsToUint(means) & 0x7fffffffu, uvec3(0x7f800000u)));
    if (crowded || !finite) {
        control[0] = 1;
        mailbox[crowded ? 1 : 2] = crowded ? counts[0] : 1;
        return;
    }
    history[iteration] = Record(means.x, means.y, means.z, counts[0], population[0]);
    mailbox[0] = iteration + 1;
}
