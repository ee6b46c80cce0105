#version 450
#extension GL_GOOGLE_include_directive : require
// Held-out metrics: a workgroup per surface point. Which cameras see the point (hard gate, exact
// occlusion), and from its reachable directions how far the nearest of them is. Twin: src/planner/metrics/score_point.rs.
#include "shared/fold.glsl"
#include "shared/angle.glsl"
#include "shared/octahedral.glsl"
#include "shared/bvh.glsl"
#include "shared/probe.glsl"
layout(local_size_x = 256) in;

layout(push_constant) uniform Push {
    uint first;        // point of the first workgroup
    uint views;
    uint resolution;   // texels along a side
    uint frustum;      // 1: the rectangular image, 0: the cone inscribed in it
};

#include "planner/metrics/view.glsl"

struct Score {
    uint views;
    float reachable;   // steradians
    float gap;         // radians
    float voronoi_mean;
    float voronoi_deviation;
    float triangulation;
    float sampling_distance;
    float spare0;
};

layout(binding = 0, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 1, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 2, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 3, std430) readonly buffer Depth { float depth[]; };
layout(binding = 4, std430) readonly buffer Cameras { View cameras[]; };
// Unit directions from each point of this dispatch to the cameras that see it, `views` to a point; and how many texels
// are nearest to each.
layout(binding = 5, std430) coherent buffer Rays { vec4 rays[]; };
layout(binding = 6, std430) coherent buffer Cells { uint cells[]; };
layout(binding = 7, std430) writeonly buffer Scores { Score scores[]; };
#include "shared/traverse.glsl"

shared uint words[8];
shared vec2 sums[256];

bool sees(View view, vec3 v) {
    if (frustum == 0) return dot(v, view.forward) >= view.cone_cos;
    float z = dot(v, view.forward);
    return z > 0.0 && abs(dot(v, view.right)) <= z && abs(dot(v, view.down)) <= z;
}

vec2 total_of(vec2 value) {
    uint thread = gl_LocalInvocationIndex;
    barrier();
    sums[thread] = value;
    FOLD(thread, 256, sums[thread] += sums[thread + apart]);
    barrier();
    return sums[0];
}

float maximum_of(float value) {
    uint thread = gl_LocalInvocationIndex;
    barrier();
    sums[thread].x = value;
    FOLD(thread, 256, sums[thread].x = max(sums[thread].x, sums[thread + apart].x));
    barrier();
    return sums[0].x;
}

void main() {
    uint point = first + gl_WorkGroupID.x, thread = gl_LocalInvocationIndex;
    vec3 position = probes[point].position;
    uint row = gl_WorkGroupID.x * views;
    float finest = MISS;

    uint count = 0;
    for (uint base = 0; base < views; base += 256) {
        if (thread < 8) words[thread] = 0;
        barrier();
        uint j = base + thread;
        bool seen = false;
        vec3 n = vec3(0.0);
        if (j < views) {
            View view = cameras[j];
            vec3 ray = view.position - position;
            float d = max(length(ray), 1e-6);
            n = ray / d;
            seen = sees(view, -n) && faces(probes[point], n) && trace(position, n, 0.0, d, true) >= MISS;
            if (seen) finest = min(finest, d / view.focal);
        }
        if (seen) atomicOr(words[thread >> 5], 1u << (thread & 31u));
        barrier();
        uint rank = count, all = count;
        for (uint k = 0; k < 8; ++k) {
            uint bits = bitCount(words[k]);
            if (k < (thread >> 5)) rank += bits;
            all += bits;
        }
        rank += bitCount(words[thread >> 5] & ((1u << (thread & 31u)) - 1u));
        if (seen) {
            rays[row + rank] = vec4(n, 0.0);
            cells[row + rank] = 0;
        }
        count = all;
        barrier();
    }
    memoryBarrierBuffer();
    barrier();

    // Reachable directions go to the nearest view: the mean of that angle is the gap, the texels of a view its cell.
    uint texels = resolution * resolution;
    vec2 reach = vec2(0.0);
    for (uint t = thread; t < texels; t += 256) {
        if (depth[point * texels + t] <= 0.0) continue;
        vec3 w = octahedral_texel_centre(t, resolution);
        float best = 8.0;
        uint nearest = 0;
        // Eight at a time: lavapipe ends an invocation's loops after 65,535 iterations.
        for (uint first_ = 0; first_ < count; first_ += 8) {
            for (uint i = 0; i < 8; ++i) {
                uint k = min(first_ + i, count - 1);
                vec3 chord = w - rays[row + k].xyz;
                float distance_ = dot(chord, chord);
                if (distance_ < best) {
                    best = distance_;
                    nearest = k;
                }
            }
        }
        if (count > 0) atomicAdd(cells[row + nearest], 1u);
        reach += vec2(1.0, count > 0 ? 2.0 * asin(min(0.5 * sqrt(best), 1.0)) : 3.14159265);
    }
    reach = total_of(reach);
    memoryBarrierBuffer();
    barrier();
    float texel_area = 12.5663706 / float(texels);
    float mean = count > 0 ? reach.x * texel_area / float(count) : 0.0;
    float square = 0.0, widest = 0.0;
    for (uint k = thread; k < count; k += 256) {
        float off = float(cells[row + k]) * texel_area - mean;
        square += off * off;
        // Pairs grow as the square: past 1024 views that see the point the first 1024 represent all.
        for (uint l = 0; l < (k < 1024 ? k : 0); ++l) widest = max(widest, angle_between(rays[row + k].xyz, rays[row + l].xyz));
    }
    square = total_of(vec2(square, 0.0)).x;
    widest = maximum_of(widest);
    finest = -maximum_of(-finest);
    if (thread == 0) {
        float deviation = count > 0 ? sqrt(square / float(count)) : 0.0;
        scores[point] = Score(count, reach.x * texel_area, reach.x > 0.0 ? reach.y / reach.x : 0.0, mean,
                                             deviation, widest, count > 0 ? finest : 0.0, 0.0);
    }
}
