// Needs the binding `primitives` of traverse.glsl, which holds triangles.

// Distance along the ray to a triangle, from either side; MISS where there is none. `at` are the weights of the second and
// third corner. Moeller and Trumbore 1997.
float intersect_triangle(uint slot, vec3 origin, vec3 direction, out vec2 at) {
    vec3 v0 = primitives[3 * slot].xyz, e1 = primitives[3 * slot + 1].xyz, e2 = primitives[3 * slot + 2].xyz;
    at = vec2(0.0);
    vec3 p = cross(direction, e2);
    float determinant = dot(e1, p);
    if (determinant == 0.0) return MISS;
    vec3 s = origin - v0;
    float u = dot(s, p) / determinant;
    vec3 q = cross(s, e1);
    float v = dot(direction, q) / determinant;
    if (!(u >= -1e-6 && v >= -1e-6 && u + v <= 1.000001)) return MISS;
    at = vec2(u, v);
    return dot(e2, q) / determinant;
}
