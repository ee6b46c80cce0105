// Needs the binding `primitives` of traverse.glsl, which holds triangles.

struct Triangle {
    vec3 v0;
    vec3 e1;
    vec3 e2;
};

Triangle triangle_at(uint slot) {
    return Triangle(primitives[3 * slot].xyz, primitives[3 * slot + 1].xyz, primitives[3 * slot + 2].xyz);
}

// Distance along the ray to a triangle, from either side; MISS where there is none. `at` are the weights of the second and
// third corner. Moeller and Trumbore 1997.
float intersect_triangle(Triangle triangle, vec3 origin, vec3 direction, out vec2 at) {
    vec3 p = cross(direction, triangle.e2);
    float determinant = dot(triangle.e1, p);
    vec3 s = origin - triangle.v0;
    float u = dot(s, p) / determinant;
    vec3 q = cross(s, triangle.e1);
    float v = dot(direction, q) / determinant;
    at = vec2(u, v);
    float t = dot(triangle.e2, q) / determinant;
    // Without branches, so that several triangles can be in work at once.
    return determinant != 0.0 && u >= -1e-6 && v >= -1e-6 && u + v <= 1.000001 ? t : MISS;
}
