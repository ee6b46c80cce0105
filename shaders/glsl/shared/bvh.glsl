// Rays through the bounding volume hierarchy of src/visibility/bvh.rs. Twin, with the same formulae in the same
// precision: src/visibility/raycast.rs. Needs the bindings `nodes` (of Node) and `primitives` (vec4: three to a triangle,
// two to a disc).

layout(constant_id = 5) const bool DISCS = false;  // whether the primitives are discs

const uint LEAF = 0x80000000u;
const uint COUNT_SHIFT = 27;
const uint STACK = 48;
const float MISS = 1e30;

struct Node {
    vec3 lo0;
    uint child0;
    vec3 hi0;
    uint child1;
    vec3 lo1;
    uint pad0;
    vec3 hi1;
    uint pad1;
};

float inverse_slope(float slope) {
    return 1.0 / (abs(slope) < 1e-12 ? (slope < 0.0 ? -1e-12 : 1e-12) : slope);
}

// Distance at which the ray enters a box, MISS where it does not. Far ends are widened so that rounding loses no box.
float enter_box(vec3 origin, vec3 inverse, float t_min, float t_max, vec3 lo, vec3 hi) {
    vec3 a = (lo - origin) * inverse, b = (hi - origin) * inverse;
    vec3 near = min(a, b), far = max(a, b);
    float enter = max(max(max(near.x, near.y), near.z), t_min);
    float leave = min(min(min(far.x, far.y), far.z) * 1.0000004, t_max);
    return enter <= leave ? enter : MISS;
}

const uint NO_CHILD = 0xffffffffu;  // has the leaf bit set, but is no leaf: leaves hold four at most

// The child of a node that a ray enters first, and the one that it enters later.
uvec2 children_entered(Node node, vec3 origin, vec3 inverse, float t_min, float t_max) {
    float enter0 = enter_box(origin, inverse, t_min, t_max, node.lo0, node.hi0);
    float enter1 = enter_box(origin, inverse, t_min, t_max, node.lo1, node.hi1);
    bool hit0 = enter0 < MISS, hit1 = enter1 < MISS, first = hit0 && (!hit1 || enter0 <= enter1);
    uint near = first ? node.child0 : (hit1 ? node.child1 : NO_CHILD);
    return uvec2(near, hit0 && hit1 ? (first ? node.child1 : node.child0) : NO_CHILD);
}
