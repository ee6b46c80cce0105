#version 450
#extension GL_GOOGLE_include_directive : require
// Exposure, 1: the picture as the photo's exposure shows it, in place.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/exposure.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Exposures { ExposureState exposures[]; };
layout(binding = 2, std430) buffer Picture { vec4 picture[]; };

void main() {
    View camera = views[view];
    uint texel = group_index() * 256 + gl_LocalInvocationIndex;
    if (texel >= camera.width * camera.height) return;
    ExposureState state = exposures[view];
    vec4 drawn = picture[texel];
    vec3 behind = drawn.w * background;
    vec3 shown = (drawn.xyz - behind) * rows_of(state) + (1.0 - drawn.w) * offset_of(state) + behind;
    picture[texel] = vec4(shown, drawn.w);
}
