#version 450
#extension GL_GOOGLE_include_directive : require
// What one photo shows of each surface point: its intensity, averaged over the point's footprint, or UNSEEN. Twin:
// src/photogrammetry/vds/observe.rs.
#include "shared/group.glsl"
#include "shared/bvh.glsl"
#include "photogrammetry/vds/lens.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint points;
    uint view;         // index into `views`
    uint width;        // texels of the photo's finest level
    uint height;
    uint levels;       // of the pyramid
    uint matched;      // where in `photo` a bit per point begins: whether the photo is known to see it
};

struct ObservedPoint {
    vec3 position;
    float lift;        // how far to step off the surface before the ray is cast
    vec3 normal;
    float footprint;   // width of what is averaged over
};

layout(binding = 0, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 1, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 2, std430) readonly buffer Surface { ObservedPoint surface[]; };
layout(binding = 3, std430) readonly buffer Views { LensView views[]; };
// Luma times mask and mask, 16 bits each, level after level, row by row; behind them the bits of `matched`.
layout(binding = 4, std430) readonly buffer Photo { uint photo[]; };
layout(binding = 5, std430) writeonly buffer Intensities { float intensities[]; };
#include "shared/traverse.glsl"

const float UNSEEN = -1.0;
const float MIN_COSINE = 0.17;

vec2 texel(uint offset, uvec2 size, ivec2 at) {
    uvec2 inside = uvec2(clamp(at, ivec2(0), ivec2(size) - 1));
    return unpackUnorm2x16(photo[offset + inside.y * size.x + inside.x]);
}

// Luma times mask, and mask, at `pixel` of the finest level, between the four nearest texels of a level.
vec2 bilinear(uint level, vec2 pixel) {
    uint offset = 0;
    uvec2 size = uvec2(width, height);
    for (uint l = 0; l < level; ++l) {
        offset += size.x * size.y;
        size = (size + 1u) / 2u;
    }
    vec2 at = pixel / float(1u << level) - 0.5;
    ivec2 corner = ivec2(floor(at));
    vec2 part = at - floor(at);
    vec2 upper = mix(texel(offset, size, corner), texel(offset, size, corner + ivec2(1, 0)), part.x);
    vec2 lower = mix(texel(offset, size, corner + ivec2(0, 1)), texel(offset, size, corner + ivec2(1, 1)), part.x);
    return mix(upper, lower, part.y);
}

float observe(ObservedPoint point, LensView view_, bool known) {
    vec3 away = view_.position - point.position;
    float distance_ = length(away);
    float cosine = dot(point.normal, away) / distance_;
    vec2 pixel;
    if (!(known || cosine > MIN_COSINE) || !lens_pixel(view_, point.position, pixel)) return UNSEEN;
    float texels = float(width) / view_.size.x;
    pixel *= texels;
    if (bilinear(0, pixel).y < 0.5) return UNSEEN;
    vec3 origin = point.position + point.lift * point.normal;
    vec3 ray = view_.position - origin;
    float reach = length(ray);
    if (!known && trace(origin, ray / reach, 0.0, reach, true) < MISS) return UNSEEN;
    // The width of a square as large as the footprint looks from here.
    float wide = texels * view_.focal.x * point.footprint / distance_ * sqrt(max(cosine, MIN_COSINE));
    float level = clamp(log2(wide), 0.0, float(levels - 1u));
    uint finer = uint(level);
    vec2 value = mix(bilinear(finer, pixel), bilinear(min(finer + 1, levels - 1), pixel), level - float(finer));
    return value.y > 0.0 ? value.x / value.y : UNSEEN;
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= points) return;
    bool known = (photo[matched + i / 32] >> (i % 32) & 1u) != 0;
    intensities[i] = observe(surface[i], views[view], known);
}
