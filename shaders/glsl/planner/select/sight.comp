#version 450
#extension GL_GOOGLE_include_directive : require
// Which photos see which points: a workgroup per point and 64 photos, a ray per pair whose point lies in the image.
// Twin: src/planner/select/sight.rs.
#include "shared/group.glsl"
#include "shared/bvh.glsl"
#include "shared/probe.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    uint first;   // point of the first workgroups
    uint points;  // of this dispatch
    uint photos;
    uint words;   // of a point's row of bits, an even number
};

layout(binding = 0, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 1, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 2, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 3, std430) readonly buffer Centres { vec4 centres[]; };
// A bit per point and photo: whether the point lies in the image; and whether the photo sees it.
layout(binding = 4, std430) readonly buffer Framed { uint framed[]; };
layout(binding = 5, std430) writeonly buffer Seen { uint seen[]; };
#include "shared/traverse.glsl"

shared uint bits[2];

void main() {
    uint group = group_index(), thread = gl_LocalInvocationIndex, pairs = words / 2;
    uint row = group / pairs, pair = group % pairs;
    if (row >= points) return;
    uint point = first + row, word = point * words + 2 * pair;
    if (thread < 2) bits[thread] = 0;
    barrier();
    uint photo = 64 * pair + thread;
    if (photo < photos && (framed[word + (thread >> 5)] >> (thread & 31u) & 1u) != 0) {
        vec3 position = probes[point].position, ray = centres[photo].xyz - position;
        float d = max(length(ray), 1e-6);
        vec3 n = ray / d;
        // A bit has one writer: in whatever order they come, the word is the same.
        if (faces(probes[point], n) && trace(position, n, 0.0, d, true) >= MISS) {
            atomicOr(bits[thread >> 5], 1u << (thread & 31u));
        }
    }
    barrier();
    if (thread < 2) seen[word + thread] = bits[thread];
}
