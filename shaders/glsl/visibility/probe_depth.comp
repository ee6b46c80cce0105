#version 450
#extension GL_GOOGLE_include_directive : require
// What a point camera sees of the surface, once for the whole run: the distance to the first hit along each texel, and
// (as its sign) whether the segment up to there meets the feasible region. Twin: src/visibility/probe_depth.rs.
#include "shared/group.glsl"
#include "shared/octahedral.glsl"
#include "shared/bvh.glsl"
#include "shared/probe.glsl"
#include "shared/region_types.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint first;       // probe of the first row
    uint rays;        // of this dispatch
    uint resolution;  // texels along a side
};

layout(binding = 0, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 1, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 2, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 3, std430) readonly buffer RegionBlock { DeviceRegion region[]; };
layout(binding = 4, std430) readonly buffer FreeDistance { float free_distance[]; };
layout(binding = 5, std430) writeonly buffer Depth { float depth[]; };
#include "shared/traverse.glsl"
#include "shared/region.glsl"

// Depth of the directions behind a disc: everything there is hidden.
const float BEHIND = 1e-6;

// Does the ray meet the feasible region before `reach`? Steps by the free-space field, which is a distance.
bool meets_region(vec3 origin, vec3 w, float reach) {
    float near = 0.0, far = reach;
    if (region[0].is_box != 0) {
        vec3 inverse = vec3(inverse_slope(w.x), inverse_slope(w.y), inverse_slope(w.z));
        vec3 a = (region[0].box_min - origin) * inverse, b = (region[0].box_max - origin) * inverse;
        vec3 lo = min(a, b), hi = max(a, b);
        near = max(near, max(max(lo.x, lo.y), lo.z));
        far = min(far, min(min(hi.x, hi.y), hi.z));
    } else {
        float m = dot(origin, w), outer = m * m - dot(origin, origin) + region[0].r_max * region[0].r_max;
        if (outer < 0.0) return false;
        near = max(near, -m - sqrt(outer));
        far = min(far, -m + sqrt(outer));
    }
    // The middles of what lies within the shape: steps of half a voxel could pass over a region thinner than that.
    float hollow_in = far, hollow_out = near;
    if (region[0].is_box == 0) {
        float m = dot(origin, w), inner = m * m - dot(origin, origin) + region[0].r_min * region[0].r_min;
        if (inner > 0.0) {
            hollow_in = clamp(-m - sqrt(inner), near, far);
            hollow_out = clamp(-m + sqrt(inner), near, far);
        }
    }
    if (near < far && region_contains(origin + 0.5 * (near + hollow_in) * w)) return true;
    if (near < far && region_contains(origin + 0.5 * (hollow_out + far) * w)) return true;
    float step_ = 0.5 * region[0].cell;
    float t = near;
    for (uint k = 0; k < 512 && t <= far; ++k) {
        vec3 p = origin + t * w;
        if (region_contains(p)) return true;
        float inner = region[0].is_box != 0 ? 0.0 : max(region[0].r_min - length(p), 0.0);
        t += max(max(free_space(p).w - region[0].cell, inner), step_);
    }
    return false;
}

void main() {
    uint ray = group_index() * 64 + gl_LocalInvocationIndex;
    if (ray >= rays) return;
    uint texels = resolution * resolution;
    uint row = first + ray / texels, texel = ray % texels;
    vec3 origin = probes[row].position, w = octahedral_texel_centre(texel, resolution);
    if (!faces(probes[row], w)) {
        depth[row * texels + texel] = -BEHIND;
        return;
    }
    float t = trace(origin, w, 0.0, MISS, false);
    depth[row * texels + texel] = meets_region(origin, w, t) ? t : -t;
}
