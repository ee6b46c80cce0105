#version 450
#extension GL_GOOGLE_include_directive : require
// Depth of each pixel of one view: planes parallel to its picture, evenly spaced in inverse depth, carry the neighbours to
// it, and the plane where they look most alike wins (Collins 1996, "A Space-Sweep Approach to True Multi-Image Matching").
// Twin: src/photogrammetry/stereo/cost.rs.
#include "photogrammetry/stereo/stereo.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(push_constant) uniform Push {
    vec3 origin;  // of the hull's voxels
    float cell;
    uint cells_x;
    uint cells_y;
    uint cells_z;
    uint reference;
    uint hypotheses;
    uint first_row;  // of this dispatch
};

layout(binding = 0, std430) readonly buffer Views { StereoView views[]; };
layout(binding = 1, std430) readonly buffer Pictures { float pictures[]; };
layout(binding = 2, std430) readonly buffer Pairs { StereoPair pairs[]; };
#include "photogrammetry/stereo/zncc.glsl"
layout(binding = 3, std430) readonly buffer Hull { uint hull[]; };
layout(binding = 4, std430) writeonly buffer Planes { vec4 planes[]; };
#include "photogrammetry/stereo/hull.glsl"

float inverse_depth(StereoView view, uint k) {
    return mix(1.0 / view.far, 1.0 / view.near, float(k) / float(hypotheses - 1));
}

void main() {
    StereoView view = views[reference];
    ivec2 pixel = ivec2(gl_GlobalInvocationID.x, first_row + gl_GlobalInvocationID.y);
    if (pixel.x >= view.width || pixel.y >= view.height) return;
    vec2 centre = vec2(pixel) + 0.5;
    Window around = window(view, pixel);
    // The winner, the costs before and after it, and the last cost seen.
    float best = NO_MATCH, before = NO_MATCH, after = NO_MATCH, last = NO_MATCH;
    uint winner = 0;
    for (uint k = 0; k < hypotheses; ++k) {
        float w = inverse_depth(view, k), cost = NO_MATCH;
        if (in_hull(unproject(view, centre, 1.0 / w))) cost = plane_cost(view, reference, centre, vec3(0.0, 0.0, w), around);
        if (k == winner + 1) after = cost;
        if (cost < best) {
            best = cost;
            winner = k;
            before = last;
            after = NO_MATCH;
        }
        last = cost;
    }
    float w = best < NO_MATCH ? inverse_depth(view, winner) : 0.0;
    // The parabola through the winner and both beside it, where its lowest point matches better indeed.
    float bend = before - 2.0 * best + after;
    if (before < NO_MATCH && after < NO_MATCH && bend > 1e-6) {
        float spacing = (1.0 / view.near - 1.0 / view.far) / float(hypotheses - 1);
        float between = w + clamp(0.5 * (before - after) / bend, -0.5, 0.5) * spacing;
        float cost = plane_cost(view, reference, centre, vec3(0.0, 0.0, between), around);
        if (cost < best) {
            best = cost;
            w = between;
        }
    }
    planes[uint(pixel.y) * view.width + uint(pixel.x)] = vec4(0.0, 0.0, w, best);
}
