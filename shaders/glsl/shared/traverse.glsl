// Traversal proper: included after the bindings that bvh.glsl names.
#include "shared/triangle.glsl"

// What the host stores of a primitive: a corner and two edges, or a centre with the radius and a normal.
struct Primitive {
    vec4 a;
    vec4 b;
    vec4 c;
};

Primitive primitive_at(uint slot) {
    return DISCS ? Primitive(primitives[2 * slot], primitives[2 * slot + 1], vec4(0.0))
                 : Primitive(primitives[3 * slot], primitives[3 * slot + 1], primitives[3 * slot + 2]);
}

// Distance along the ray to a primitive, from either side; MISS where there is none in [t_min, t_max].
float intersect(Primitive primitive, vec3 origin, vec3 direction, float t_min, float t_max) {
    float t;
    if (DISCS) {
        vec4 disc = primitive.a;
        vec3 normal = primitive.b.xyz;
        float slope = dot(normal, direction);
        vec3 to_centre = disc.xyz - origin;
        t = dot(normal, to_centre) / slope;
        vec3 off = t * direction - to_centre;
        if (slope == 0.0 || !(dot(off, off) <= disc.w * disc.w)) return MISS;
    } else {
        vec2 at;
        t = intersect_triangle(Triangle(primitive.a.xyz, primitive.b.xyz, primitive.c.xyz), origin, direction, at);
    }
    return t >= t_min && t <= t_max ? t : MISS;
}

// Distance to the closest hit in [t_min, t_max], or MISS, and the slot of what is hit; with `any_hit` the first hit that is met
// will do.
float trace_slot(vec3 origin, vec3 direction, float t_min, float t_max, bool any_hit, out uint slot) {
    slot = 0;
    vec3 inverse = vec3(inverse_slope(direction.x), inverse_slope(direction.y), inverse_slope(direction.z));
    uint stack[STACK];
    uint size = 0, child = 0;
    float best = MISS;
    while (true) {
        DESCEND(child, stack, size, origin, inverse, t_min, t_max, !any_hit)
        if (child == NO_CHILD) break;
        uint first = child & ((1u << COUNT_SHIFT) - 1u), count = (child ^ LEAF) >> COUNT_SHIFT;
        // All of a leaf together, also past its end: one after another, each would wait for memory.
        float t[LEAF_SIZE];
        for (uint k = 0; k < LEAF_SIZE; ++k) {
            t[k] = intersect(primitive_at(first + min(k, max(count, 1) - 1)), origin, direction, t_min, t_max);
        }
        for (uint k = 0; k < LEAF_SIZE; ++k) {
            if (k < count && t[k] < MISS && t[k] <= t_max) {
                best = t[k];
                t_max = t[k];
                slot = first + k;
                if (any_hit) return best;
            }
        }
        if (size == 0) break;
        child = stack[--size];
    }
    return best;
}

float trace(vec3 origin, vec3 direction, float t_min, float t_max, bool any_hit) {
    uint slot;
    return trace_slot(origin, direction, t_min, t_max, any_hit, slot);
}
