#version 450
#extension GL_GOOGLE_include_directive : require
// How many views' depths agree with a pixel's, and how many see through it. Twin: src/photogrammetry/stereo/consistency.rs.
#include "photogrammetry/stereo/stereo.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(push_constant) uniform Push {
    uint reference;
    uint count;       // views
    float tolerance;  // of depth, as a fraction
};

layout(binding = 0, std430) readonly buffer Views { StereoView views[]; };
layout(binding = 1, std430) readonly buffer Depths { float depths[]; };
layout(binding = 2, std430) writeonly buffer Support { uint support[]; };

void main() {
    StereoView view = views[reference];
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= view.width || pixel.y >= view.height) return;
    uint me = view.first + pixel.y * view.width + pixel.x;
    uint agree = 0, through = 0;
    if (depths[me] > 0.0) {
        vec3 p = unproject(view, vec2(pixel) + 0.5, depths[me]);
        for (uint other = 0; other < count; ++other) {
            if (other == reference) continue;
            vec3 at = project(views[other], p);
            if (at.z <= 0.0 || !in_picture(views[other], at.xy)) continue;
            uvec2 there = uvec2(at.xy);
            float depth = depths[views[other].first + there.y * views[other].width + there.x];
            if (depth <= 0.0) continue;
            float off = at.z / depth - 1.0;
            if (abs(off) <= tolerance) ++agree;
            else if (off < -3.0 * tolerance) ++through;
        }
    }
    support[me] = agree | through << 16;
}
