#version 450
#extension GL_GOOGLE_include_directive : require
// Which voxels may be the object: those in no view beside its mask (Laurentini 1994, "The Visual Hull Concept for
// Silhouette-Based Image Understanding") that few views' depths see through: fewer than two, or no more than have their
// own depth there. A picture gives no evidence about what lies outside it. Twin: src/photogrammetry/stereo/hull.rs.
#include "shared/group.glsl"
#include "photogrammetry/stereo/stereo.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    vec3 origin;  // lowest corner of the first voxel
    float cell;
    uint cells_x;
    uint cells_y;
    uint cells_z;
    uint count;   // views
    uint least;   // views that must hold a voxel
    float behind; // how far behind a voxel a depth is that sees through it; nearer, it is there
    uint first;   // workgroup
};

layout(binding = 0, std430) readonly buffer Views { StereoView views[]; };
layout(binding = 1, std430) readonly buffer Masks { float masks[]; };
layout(binding = 2, std430) readonly buffer Depths { float depths[]; };
layout(binding = 3, std430) writeonly buffer Hull { uint hull[]; };

// Coverage of a pixel from which it counts as the object: a thin part does not fill its pixels.
const float COVERED = 0.3;
// Views that must see through an empty voxel.
const uint VOTES = 2;

void main() {
    uint voxel = (first + group_index()) * 64 + gl_LocalInvocationIndex;
    if (voxel >= cells_x * cells_y * cells_z) return;
    uvec3 at = uvec3(voxel % cells_x, voxel / cells_x % cells_y, voxel / (cells_x * cells_y));
    vec3 p = origin + cell * (vec3(at) + 0.5);
    uint held = 0, through = 0, there = 0;
    bool beside = false;
    for (uint v = 0; v < count && !beside; ++v) {
        vec3 seen = project(views[v], p);
        if (seen.z <= 0.0 || !in_picture(views[v], seen.xy)) continue;
        ++held;
        uint texel = views[v].first + uint(seen.y) * views[v].width + uint(seen.x);
        beside = masks[texel] < COVERED;
        if (depths[texel] > seen.z + behind) ++through;
        else if (depths[texel] >= seen.z - behind) ++there;
    }
    bool open = through >= VOTES && through > there;
    hull[voxel] = !beside && held >= least && !open ? 1 : 0;
}
