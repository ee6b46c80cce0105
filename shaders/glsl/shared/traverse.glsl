// Traversal proper: included after the bindings that bvh.glsl names.
#include "shared/triangle.glsl"

// Distance along the ray to a primitive, from either side; MISS where there is none in [t_min, t_max].
float intersect(uint slot, vec3 origin, vec3 direction, float t_min, float t_max) {
    float t;
    if (DISCS) {
        vec4 disc = primitives[2 * slot];
        vec3 normal = primitives[2 * slot + 1].xyz;
        float slope = dot(normal, direction);
        vec3 to_centre = disc.xyz - origin;
        t = dot(normal, to_centre) / slope;
        vec3 off = t * direction - to_centre;
        if (slope == 0.0 || !(dot(off, off) <= disc.w * disc.w)) return MISS;
    } else {
        vec2 at;
        t = intersect_triangle(slot, origin, direction, at);
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
        // Down to the next leaf: neighbouring rays then do the same thing.
        while ((child & LEAF) == 0) {
            uvec2 entered = children_entered(nodes[child], origin, inverse, t_min, t_max);
            if (entered.y != NO_CHILD) stack[size++] = entered.y;
            child = entered.x;
            if (child == NO_CHILD && size > 0) child = stack[--size];
        }
        if (child == NO_CHILD) break;
        uint first = child & ((1u << COUNT_SHIFT) - 1u), count = (child ^ LEAF) >> COUNT_SHIFT;
        for (uint k = 0; k < count; ++k) {
            float t = intersect(first + k, origin, direction, t_min, t_max);
            if (t < MISS) {
                best = t;
                t_max = t;
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
