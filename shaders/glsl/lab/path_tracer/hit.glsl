// Rays through triangles with materials: closest hits, and how much light passes between two places. Needs the bindings
// `nodes`, `primitives`, `vertices`, `faces`, `materials`, `maps`, `texels` and `setting`.
#include "shared/triangle.glsl"

struct Hit {
    float t;  // MISS: nothing
    uint slot;
    vec2 at;
};

// Mean of a triangle's corners' texture coordinates by the weights of a hit.
vec2 uv0_at(Face face, vec2 at) {
    return (1.0 - at.x - at.y) * vertices[face.a].uv0 + at.x * vertices[face.b].uv0 + at.y * vertices[face.c].uv0;
}

vec2 uv1_at(Face face, vec2 at) {
    return (1.0 - at.x - at.y) * vertices[face.a].uv1 + at.x * vertices[face.b].uv1 + at.y * vertices[face.c].uv1;
}

vec4 colour_at(Face face, vec2 at) {
    return (1.0 - at.x - at.y) * unpackUnorm4x8(vertices[face.a].colour) + at.x * unpackUnorm4x8(vertices[face.b].colour)
        + at.y * unpackUnorm4x8(vertices[face.c].colour);
}

// Share of the light that a triangle with alpha stops.
float opacity(uint slot, vec2 at) {
    Face face = faces[slot];
    uint map = materials[face.material].base_map;
    float alpha = materials[face.material].alpha * colour_at(face, at).a;
    if (map != NONE) alpha *= map_at(map, uv0_at(face, at), uv1_at(face, at)).a;
    if ((materials[face.material].flags & ALPHA_MASK) != 0) return alpha < materials[face.material].cutoff ? 0.0 : 1.0;
    return alpha;
}

// Whether a triangle's alpha must be looked at.
bool has_alpha(uint slot) {
    return primitives[3 * slot + 1].w != 0.0;
}

// The closest hit but for the triangle in slot `own`, where the ray starts. What stops a share of the light stops the ray where
// a number in [0, 1) of `key` and the triangle is below that share; without a key (0), where it is half or more.
Hit closest(vec3 origin, vec3 direction, uint own, uvec3 key, bool keyed) {
    vec3 inverse = vec3(inverse_slope(direction.x), inverse_slope(direction.y), inverse_slope(direction.z));
    uint stack[STACK];
    uint size = 0, child = 0;
    Hit best = Hit(MISS, NONE, vec2(0.0));
    while (true) {
        DESCEND(child, stack, size, origin, inverse, 0.0, best.t, true)
        if (child == NO_CHILD) break;
        uint first = child & ((1u << COUNT_SHIFT) - 1u), count = (child ^ LEAF) >> COUNT_SHIFT;
        for (uint k = 0; k < count; ++k) {
            uint slot = first + k;
            vec2 at;
            float t = intersect_triangle(triangle_at(slot), origin, direction, at);
            // Of equals the lower slot stays, whatever the order of the boxes.
            if (!(t >= 0.0 && t <= best.t) || t >= MISS || (t == best.t && slot > best.slot) || slot == own) continue;
            if (has_alpha(slot)) {
                float least = keyed ? float(pcg4d(uvec4(key, slot)).x >> 8u) * 5.9604644775390625e-8 : 0.4999;
                if (opacity(slot, at) <= least) continue;
            }
            best = Hit(t, slot, at);
        }
        if (size == 0) break;
        child = stack[--size];
    }
    return best;
}

// Share of the light that passes along a ray up to `t_max`; the triangles where it starts and ends, in the slots `own` and
// `lit`, stop none.
float passing(vec3 origin, vec3 direction, float t_max, uint own, uint lit) {
    vec3 inverse = vec3(inverse_slope(direction.x), inverse_slope(direction.y), inverse_slope(direction.z));
    uint stack[STACK];
    uint size = 0, child = 0;
    float left = 1.0;
    while (true) {
        DESCEND(child, stack, size, origin, inverse, 0.0, t_max, true)
        if (child == NO_CHILD) break;
        uint first = child & ((1u << COUNT_SHIFT) - 1u), count = (child ^ LEAF) >> COUNT_SHIFT;
        for (uint k = 0; k < count; ++k) {
            vec2 at;
            float t = intersect_triangle(triangle_at(first + k), origin, direction, at);
            if (!(t >= 0.0 && t < t_max) || first + k == own || first + k == lit) continue;
            left *= has_alpha(first + k) ? 1.0 - opacity(first + k, at) : 0.0;
            if (left <= 0.0) return 0.0;
        }
        if (size == 0) break;
        child = stack[--size];
    }
    return left;
}

// A place beside a hit on the side that `normal` points to, farther off its triangle's plane than rounding may have left the
// place and a neighbour in that plane (but for slivers): by eight units in the last place of the terms that it is the sum of,
// along the normal (Pharr, Jakob and Humphreys 2023, "Physically Based Rendering", 6.8), and at least by the resolution of the
// scene's coordinates. The triangle itself is left out by its slot.
vec3 beside(Hit hit, vec3 place, vec3 normal) {
    vec3 v0 = primitives[3 * hit.slot].xyz, e1 = primitives[3 * hit.slot + 1].xyz, e2 = primitives[3 * hit.slot + 2].xyz;
    vec3 terms = abs(v0) + abs(hit.at.x * e1) + abs(hit.at.y * e2);
    return place + (dot(terms, abs(normal)) * 9.5367431640625e-7 + setting[0].radius * 2.384185791015625e-7) * normal;
}
