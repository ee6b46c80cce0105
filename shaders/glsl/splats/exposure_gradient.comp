#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Exposure, 2: from the gradient g by each pixel as it is shown to that by what splats show, A^T g, and to those by A and b, summed over
// 256 pixels. What is left of the light counts by the background and by b: the backward pass finds both if the picture becomes
// A^-1 (shown - b), which is c over the background A^-1 (background - b).
#include "shared/group.glsl"
#include "shared/fold.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/exposure.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Exposures { ExposureState exposures[]; };
layout(binding = 2, std430) buffer Picture { vec4 picture[]; };
layout(binding = 3, std430) buffer ByPixel { vec4 by_pixel[]; };
// Three of each 256 pixels: a row of A and of b.
layout(binding = 4, std430) writeonly buffer Sums { vec4 exposure_sums[]; };

shared vec4 sums[3][256];

void main() {
    View camera = views[view];
    uint thread = gl_LocalInvocationIndex, texel = group_index() * 256 + thread, pixels = camera.width * camera.height;
    if (group_index() * 256 >= pixels) return;
    [[unroll]] for (uint r = 0; r < 3; ++r) sums[r][thread] = vec4(0.0);
    if (texel < pixels) {
        ExposureState state = exposures[view];
        mat3 rows = rows_of(state), back = inverse(transpose(rows));
        vec3 offset = offset_of(state), g = by_pixel[texel].xyz;
        vec4 shown = picture[texel];
        float hidden = 1.0 - shown.w;
        vec3 own = back * (shown.xyz - hidden * offset - shown.w * background);
        [[unroll]] for (uint r = 0; r < 3; ++r) sums[r][thread] = g[r] * vec4(own, hidden);
        picture[texel] = vec4(back * (shown.xyz - offset), shown.w);
        by_pixel[texel] = vec4(rows * g, 0.0);
    }
    FOLD(thread, 256, [[unroll]] for (uint r = 0; r < 3; ++r) sums[r][thread] += sums[r][thread + apart]);
    if (thread < 3) exposure_sums[3 * group_index() + thread] = sums[thread][0];
}
