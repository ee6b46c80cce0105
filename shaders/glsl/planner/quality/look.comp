#version 450
#extension GL_GOOGLE_include_directive : require
// Pixels of viewers: a thread casts a ray through each and notes the surface point that it shows, and from where.
// Twin: src/planner/quality/look.rs.
#include "shared/group.glsl"
#include "shared/bvh.glsl"
#include "shared/random.glsl"
#include "shared/look.glsl"
layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
    vec3 middle;       // of the surface
    float background;  // weight of looks beside the surface; 0: they count for nothing
    uint pool;         // viewers there are
    uint count;        // viewers of this draw
    uint advance;      // how many viewers an iteration moves it on by
    uint side;         // pixels of a viewer along a side of its picture
    uint seed;
    float lift;        // off a mesh
};

// A pinhole camera: the ray through image position (u, v) runs along corner + u across + v along.
struct Viewer {
    vec3 position;
    float widest;  // tangent of half the wider field of view
    vec3 corner;
    float spare0;
    vec3 across;
    float spare1;
    vec3 along;
    float spare2;
};

layout(binding = 0, std430) readonly buffer Nodes { Node nodes[]; };
layout(binding = 1, std430) readonly buffer Primitives { vec4 primitives[]; };
layout(binding = 2, std430) readonly buffer ControlBlock { uint control[]; };  // [0]: the iteration
layout(binding = 3, std430) readonly buffer Viewers { Viewer viewers[]; };
layout(binding = 4, std430) writeonly buffer Looks { Look looks[]; };
#include "shared/traverse.glsl"

const uint PIXELS = 0x6c6f6f6bu;

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex, pixels = side * side;
    if (i >= count * pixels) return;
    uint draw = control[0] * advance + i / pixels, pixel = i % pixels;
    uint index = draw % pool;
    vec2 jitter = random4(seed, PIXELS, draw, pixel).xy;
    vec2 at = (vec2(pixel % side, pixel / side % side) + jitter) / float(side);
    Viewer viewer = viewers[index];
    vec3 direction = normalize(viewer.corner + at.x * viewer.across + at.y * viewer.along);
    Look look = Look(vec3(0.0), 0.0, vec3(0.0), 0.0, vec3(0.0), 0.0);
    uint slot;
    float t = trace_slot(viewer.position, direction, 0.0, MISS, false, slot);
    if (t < MISS) {
        vec3 normal;
        float off = lift;
        bool front = true;
        if (DISCS) {
            normal = primitives[2 * slot + 1].xyz;
            off = primitives[2 * slot].w;
            // A disc is a piece of a surface that has one side.
            front = dot(normal, direction) < 0.0;
        } else {
            normal = cross(primitives[3 * slot + 1].xyz, primitives[3 * slot + 2].xyz);
            normal /= max(length(normal), 1e-30);
            if (dot(normal, direction) > 0.0) normal = -normal;
        }
        if (front) {
            look.position = viewer.position + t * direction + off * normal;
            look.distance = t;
            look.direction = -direction;
            look.normal = normal;
            look.weight = 1.0;
        }
    } else if (background > 0.0) {
        float along = dot(middle - viewer.position, direction);
        if (along > 0.0) {
            look.position = viewer.position + along * direction;
            look.distance = along;
            look.direction = -direction;
            look.weight = background;
        }
    }
    look.footprint = look.distance * viewer.widest;
    looks[i] = look;
}
