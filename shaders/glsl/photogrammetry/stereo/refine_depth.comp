#version 450
#extension GL_GOOGLE_include_directive : require
// One iteration of refinement of a view's depth: a pixel takes over the plane of a pixel beside it, or its own moved or turned a
// little at random, where that matches better (Bleyer, Rhemann and Rother 2011, "PatchMatch Stereo - Stereo Matching with
// Slanted Support Windows"). A plane is inverse depth, which is linear in the picture, and its slope. All pixels read the planes
// of the iteration before. Twin: src/photogrammetry/stereo/cost.rs.
#include "photogrammetry/stereo/stereo.glsl"
#include "shared/random.glsl"
layout(local_size_x = 8, local_size_y = 8) in;

layout(push_constant) uniform Push {
    vec3 origin;  // of the hull's voxels
    float cell;
    uint cells_x;
    uint cells_y;
    uint cells_z;
    uint reference;
    uint iteration;
    uint seed;
    int reach;     // pixels to those that planes are taken over from
    float shift;   // largest move of a plane, as a fraction of its inverse depth
    float turn;    // largest change of slope, as a fraction of inverse depth in a whole picture's width
    uint first_row;  // of this dispatch
};

layout(binding = 0, std430) readonly buffer Views { StereoView views[]; };
layout(binding = 1, std430) readonly buffer Pictures { float pictures[]; };
layout(binding = 2, std430) readonly buffer Pairs { StereoPair pairs[]; };
#include "photogrammetry/stereo/zncc.glsl"
layout(binding = 3, std430) readonly buffer Hull { uint hull[]; };
layout(binding = 4, std430) readonly buffer Planes { vec4 planes[]; };
layout(binding = 5, std430) writeonly buffer Refined { vec4 refined[]; };
#include "photogrammetry/stereo/hull.glsl"

void main() {
    StereoView view = views[reference];
    ivec2 pixel = ivec2(gl_GlobalInvocationID.x, first_row + gl_GlobalInvocationID.y);
    if (pixel.x >= view.width || pixel.y >= view.height) return;
    uint me = uint(pixel.y) * view.width + uint(pixel.x);
    vec4 best = planes[me];
    vec2 centre = vec2(pixel) + 0.5;
    Window around = window(view, pixel);
    vec4 chance = random4(seed, reference, me, iteration);
    for (uint c = 0; c < 6; ++c) {
        vec3 plane = best.xyz;
        if (c < 4) {
            ivec2 off = c == 0 ? ivec2(-reach, 0) : c == 1 ? ivec2(reach, 0) : c == 2 ? ivec2(0, -reach) : ivec2(0, reach);
            ivec2 beside = pixel + off;
            if (any(lessThan(beside, ivec2(0))) || beside.x >= view.width || beside.y >= view.height) continue;
            plane = planes[uint(beside.y) * view.width + uint(beside.x)].xyz;
            if (plane.z <= 0.0) continue;
            plane.z -= dot(plane.xy, vec2(off));
        } else if (c == 4) {
            plane.z *= 1.0 + shift * (2.0 * chance.x - 1.0);
        } else {
            plane.xy += turn * plane.z / float(view.width) * (2.0 * chance.yz - 1.0);
        }
        if (!(plane.z >= 1.0 / view.far && plane.z <= 1.0 / view.near)) continue;
        // Steeper than about 75 degrees a window is a line.
        if (length(plane.xy) * float(view.width) > 5.0 * plane.z) continue;
        if (!in_hull(unproject(view, centre, 1.0 / plane.z))) continue;
        float cost = plane_cost(view, reference, centre, plane, around);
        if (cost < best.w) best = vec4(plane, cost);
    }
    refined[me] = best;
}
