#version 450
#extension GL_GOOGLE_include_directive : require
// Manifold sampling, 4: sums over perturbed pictures of each pixel's difference to the first of them, and in the end its
// variance, summed over the colours.
#include "shared/group.glsl"
layout(local_size_x = 256) in;

layout(push_constant) uniform Push {
    uint pixels;
    // Which picture, of how many.
    uint picture_index;
    uint pictures;
};

layout(binding = 0, std430) readonly buffer Picture { vec4 picture[]; };
layout(binding = 1, std430) restrict buffer Pivot { vec4 pivot[]; };
// Sum of the differences, and of their squares.
layout(binding = 2, std430) restrict buffer Sums { vec4 sums[]; };
layout(binding = 3, std430) writeonly buffer Spread { float spread[]; };

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex;
    if (i >= pixels) return;
    if (picture_index == 0) pivot[i] = picture[i];
    vec3 away = picture_index == 0 ? vec3(0.0) : picture[i].xyz - pivot[i].xyz;
    vec4 sum = vec4(away, dot(away, away)) + (picture_index == 0 ? vec4(0.0) : sums[i]);
    sums[i] = sum;
    if (picture_index + 1 < pictures) return;
    vec3 mean = sum.xyz / float(pictures);
    // Of a sample: as in any estimate, one is lost to the mean.
    spread[i] = max(sum.w - float(pictures) * dot(mean, mean), 0.0) / float(max(pictures, 2) - 1);
}
