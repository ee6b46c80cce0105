#version 450
#extension GL_GOOGLE_include_directive : require
// Exposure, 3: Adam's step for the view's exposure, and their mean over all photos taken from each: what all photos have in common is the
// model's own colour, which would drift otherwise. One workgroup; sums in fixed order.
#include "shared/adam.glsl"
#include "shared/fold.glsl"
#include "splats/gaussian.glsl"
#include "splats/exposure.glsl"
layout(local_size_x = 256) in;

layout(push_constant) uniform Push {
    uint view;
    // Exposures that the mean is taken of: the first so many.
    uint photos;
    float rate;
    // Weight of the squares of A - 1 and b in the loss, halved.
    float pull;
};
layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Control { uint control[]; };
layout(binding = 2, std430) readonly buffer Sums { vec4 exposure_sums[]; };
layout(binding = 3, std430) coherent buffer Exposures { ExposureState exposures[]; };

shared vec4 sums[3][256];

void main() {
    if (control[0] != 0) return;
    uint thread = gl_LocalInvocationIndex;
    View camera = views[view];
    uint groups = (camera.width * camera.height + 255) / 256;
    vec4 sum[3] = vec4[](vec4(0.0), vec4(0.0), vec4(0.0));
    for (uint group = thread; group < groups; group += 256) {
        for (uint r = 0; r < 3; ++r) sum[r] += exposure_sums[3 * group + r];
    }
    for (uint r = 0; r < 3; ++r) sums[r][thread] = sum[r];
    FOLD(thread, 256, for (uint r = 0; r < 3; ++r) sums[r][thread] += sums[r][thread + apart]);
    barrier();
    if (thread < 12) {
        float first = exposures[view].first[thread], second = exposures[view].second[thread];
        adam_means(sums[thread / 4][0][thread % 4] + pull * exposures[view].value[thread], first, second);
        exposures[view].first[thread] = first;
        exposures[view].second[thread] = second;
        vec2 reciprocals = 1.0 / adam_corrections(uint(exposures[view].steps) + 1);
        exposures[view].value[thread] -= adam_step(rate, first, second, reciprocals, 1e-15);
    }
    memoryBarrierBuffer();
    barrier();
    if (thread == 0) exposures[view].steps += 1.0;
    for (uint r = 0; r < 3; ++r) sum[r] = vec4(0.0);
    for (uint photo = thread; photo < photos; photo += 256) {
        for (uint k = 0; k < 12; ++k) sum[k / 4][k % 4] += exposures[photo].value[k];
    }
    for (uint r = 0; r < 3; ++r) sums[r][thread] = sum[r];
    FOLD(thread, 256, for (uint r = 0; r < 3; ++r) sums[r][thread] += sums[r][thread + apart]);
    barrier();
    for (uint photo = thread; photo < photos; photo += 256) {
        for (uint k = 0; k < 12; ++k) exposures[photo].value[k] -= sums[k / 4][0][k % 4] / float(photos);
    }
}
