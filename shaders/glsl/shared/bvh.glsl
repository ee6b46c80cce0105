// Rays through the bounding volume hierarchy of src/visibility/bvh.rs. Twin, with the same formulae in the same
// precision: src/visibility/raycast.rs. Needs the bindings `nodes` (of Node) and `primitives` (vec4: three to a triangle,
// two to a disc).

layout(constant_id = 5) const bool DISCS = false;  // whether the primitives are discs

const uint LEAF = 0x80000000u;
const uint COUNT_SHIFT = 27;
const uint STACK = 96;
const uint LEAF_SIZE = 4;  // most primitives of a leaf
const float MISS = 1e30;

// Four children and the sides of their boxes.
struct Node {
    vec4 lo_x;
    vec4 lo_y;
    vec4 lo_z;
    vec4 hi_x;
    vec4 hi_y;
    vec4 hi_z;
    uvec4 children;
};

float inverse_slope(float slope) {
    return 1.0 / (abs(slope) < 1e-12 ? (slope < 0.0 ? -1e-12 : 1e-12) : slope);
}

const uint NO_CHILD = 0xffffffffu;  // has the leaf bit set, but is no leaf: leaves hold four at most

void order(inout float enter0, inout uint child0, inout float enter1, inout uint child1) {
    bool swap = enter1 < enter0;
    float enter = enter0;
    uint child = child0;
    enter0 = swap ? enter1 : enter0;
    child0 = swap ? child1 : child0;
    enter1 = swap ? enter : enter1;
    child1 = swap ? child : child1;
}

// The children of a node that a ray enters, nearest first if they are to be sorted; NO_CHILD for the others. Far ends of boxes are
// widened so that rounding loses none.
uvec4 children_entered(Node node, vec3 origin, vec3 inverse, float t_min, float t_max, bool sorted) {
    vec4 ax = (node.lo_x - origin.x) * inverse.x, bx = (node.hi_x - origin.x) * inverse.x;
    vec4 ay = (node.lo_y - origin.y) * inverse.y, by = (node.hi_y - origin.y) * inverse.y;
    vec4 az = (node.lo_z - origin.z) * inverse.z, bz = (node.hi_z - origin.z) * inverse.z;
    vec4 enter = max(max(max(min(ax, bx), min(ay, by)), min(az, bz)), vec4(t_min));
    vec4 leave = min(min(min(max(ax, bx), max(ay, by)), max(az, bz)) * 1.0000004, vec4(t_max));
    bvec4 hit = lessThanEqual(enter, leave);
    uvec4 child = mix(uvec4(NO_CHILD), node.children, hit);
    if (!sorted) return child;
    enter = mix(vec4(2.0 * MISS), enter, hit);
    order(enter.x, child.x, enter.y, child.y);
    order(enter.z, child.z, enter.w, child.w);
    order(enter.x, child.x, enter.z, child.z);
    order(enter.y, child.y, enter.w, child.w);
    order(enter.y, child.y, enter.z, child.z);
    return child;
}

// Goes down to the next leaf, or to NO_CHILD where there is none: neighbouring rays then do the same thing. Of the children on the
// way the first is gone to, the others wait on `stack`.
#define DESCEND(child, stack, size, origin, inverse, t_min, t_max, sorted) \
    while ((child & LEAF) == 0) { \
        uvec4 entered = children_entered(nodes[child], origin, inverse, t_min, t_max, sorted); \
        if (entered.w != NO_CHILD) stack[size++] = entered.w; \
        if (entered.z != NO_CHILD) stack[size++] = entered.z; \
        if (entered.y != NO_CHILD) stack[size++] = entered.y; \
        child = entered.x; \
        if (child == NO_CHILD && size > 0) child = stack[--size]; \
    }
