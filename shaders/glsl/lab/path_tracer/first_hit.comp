#version 450
#extension GL_GOOGLE_include_directive : require
// What lies in the middle of a pixel: the normal of the surface there, on the camera's side, and its depth along the
// optical axis; zeros where there is nothing. What stops less than half of the light is passed.
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "shared/bvh.glsl"
#include "lab/path_tracer/appearance.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    vec3 position;
    uint count;
    vec3 right;
    uint width;
    vec3 down;
    uint chosen_only;  // 1: the pixels are those of `chosen`; 0: all in their order
    vec3 forward;
    uint spare0;
    vec2 focal;
    vec2 principal;
};

layout(binding = 0, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 1, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 2, std430) readonly buffer Vertices { Vertex vertices[]; };
layout(binding = 3, std430) readonly buffer Faces { Face faces[]; };
layout(binding = 4, std430) readonly buffer Materials { Material materials[]; };
layout(binding = 5, std430) readonly buffer Maps { Map maps[]; };
layout(binding = 6, std430) readonly buffer Texels { uint texels[]; };
layout(binding = 7, std430) readonly buffer SettingBlock { Setting setting[]; };
layout(binding = 8, std430) readonly buffer Chosen { uint chosen[]; };
layout(binding = 9, std430) writeonly buffer Found { vec4 found[]; };
#include "lab/path_tracer/maps.glsl"
#include "lab/path_tracer/hit.glsl"

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= count) return;
    uint pixel = chosen_only != 0 ? chosen[i] : i;
    vec2 at = (vec2(pixel % width, pixel / width) + 0.5 - principal) / focal;
    vec3 direction = normalize(at.x * right + at.y * down + forward);
    Hit hit = closest(position, direction, NONE, uvec3(0), false);
    if (hit.t >= MISS) {
        found[i] = vec4(0.0);
        return;
    }
    Face face = faces[hit.slot];
    vec3 n = (1.0 - hit.at.x - hit.at.y) * vertices[face.a].normal + hit.at.x * vertices[face.b].normal
        + hit.at.y * vertices[face.c].normal;
    if (dot(n, n) < 1e-6) n = cross(primitives[3 * hit.slot + 1].xyz, primitives[3 * hit.slot + 2].xyz);
    n = normalize(n);
    found[i] = vec4(dot(n, direction) > 0.0 ? -n : n, hit.t * dot(direction, forward));
}
