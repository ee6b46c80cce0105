#version 450
#extension GL_GOOGLE_include_directive : require
// Where the elements of each key begin and end among sorted keys. Twin: src/engine/primitives/twin.rs.
#include "shared/group.glsl"
layout(local_size_x = 256) in;
layout(push_constant) uniform Push { uint count; uint count_index; };
layout(binding = 0, std430) readonly buffer Counts { uint counts[]; };
layout(binding = 1, std430) readonly buffer Keys { uint keys[]; };
// Zero before: a key without elements keeps an empty range.
layout(binding = 2, std430) buffer Ranges { uvec2 ranges[]; };
#include "engine/primitives/count.glsl"

void main() {
    uint i = group_index() * 256 + gl_LocalInvocationIndex, all = element_count();
    if (i >= all) return;
    uint key = keys[i];
    if (key >= ranges.length()) return;
    if (i == 0 || keys[i - 1] != key) ranges[key].x = i;
    if (i + 1 == all || keys[i + 1] != key) ranges[key].y = i + 1;
}
