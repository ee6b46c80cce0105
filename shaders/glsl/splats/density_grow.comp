#version 450
#extension GL_GOOGLE_include_directive : require
// Densification, 3: small Gaussians are cloned; wide ones become two, drawn from their own shape and smaller by a factor of 1.6.
// Slots that stay free are emptied.
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "splats/gaussian.glsl"
#include "splats/density.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Control { uint control[]; };
layout(binding = 1, std430) readonly buffer Children { uint children[]; };
layout(binding = 2, std430) readonly buffer ChildRanks { uint child_ranks[]; };
layout(binding = 3, std430) readonly buffer Holes { uint holes[]; };
layout(binding = 4, std430) readonly buffer HoleRanks { uint hole_ranks[]; };
// [0] children, [1] free slots, [2] both kinds of slots before.
layout(binding = 5, std430) readonly buffer Totals { uint totals[]; };
layout(binding = 6, std430) readonly buffer Slots { uint slots[]; };
layout(binding = 7, std430) buffer Parameters { float parameters[]; };
layout(binding = 8, std430) writeonly buffer First { float first[]; };
layout(binding = 9, std430) writeonly buffer Second { float second[]; };
layout(binding = 10, std430) writeonly buffer Statistics { vec2 statistics[]; };
layout(binding = 11, std430) writeonly buffer Population { uint population[]; };

const uint SPLIT_STREAM = 0x49000000u;
const float SHRINK = log(1.6);

void forget(uint i) {
    for (uint plane = 0; plane < planes; ++plane) {
        first[plane * stride + i] = 0.0;
        second[plane * stride + i] = 0.0;
    }
    statistics[i] = vec2(0.0);
}

// A draw from the shape of Gaussian `i`, from its centre; `which` of the two.
vec3 drawn(uint i, uint which) {
    vec4 q;
    for (uint c = 0; c < 4; ++c) q[c] = parameters[(ROTATION + c) * stride + i];
    vec3 scale;
    for (uint c = 0; c < 3; ++c) scale[c] = exp(parameters[(LOG_SCALE + c) * stride + i]);
    vec3 normal = normal3(pcg4d(uvec4(seed, SPLIT_STREAM + 2 * iteration + which, i)));
    return rotation_of(normalize(q)) * (scale * normal);
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex, before = totals[2];
    if (control[0] != 0 || i >= before) return;
    // Children that find no free slot go behind the others, while there is capacity.
    uint behind = totals[0] - min(totals[0], totals[1]);
    if (i == 0) population[0] = min(before + behind, stride);
    if (holes[i] != 0) {
        if (hole_ranks[i] >= totals[0]) {
            parameters[OPACITY * stride + i] = FREE;
            forget(i);
        }
        return;
    }
    statistics[i] = vec2(0.0);
    if (children[i] == 0) return;
    uint rank = child_ranks[i], child = rank < totals[1] ? slots[rank] : before + rank - totals[1];
    if (child >= stride) return;
    float widest = parameters[LOG_SCALE * stride + i];
    for (uint c = 1; c < 3; ++c) widest = max(widest, parameters[(LOG_SCALE + c) * stride + i]);
    bool splits = exp(widest) > wide;
    vec3 to_child = splits ? drawn(i, 0) : vec3(0.0), to_self = splits ? drawn(i, 1) : vec3(0.0);
    for (uint plane = 0; plane < planes; ++plane) {
        float value = parameters[plane * stride + i];
        if (splits && plane >= LOG_SCALE && plane < ROTATION) value -= SHRINK;
        if (splits && plane >= LOG_SCALE && plane < ROTATION) parameters[plane * stride + i] = value;
        if (splits && plane < LOG_SCALE) parameters[plane * stride + i] = value + to_self[plane];
        parameters[plane * stride + child] = plane < LOG_SCALE ? value + to_child[plane] : value;
    }
    forget(child);
    if (splits) forget(i);
}
