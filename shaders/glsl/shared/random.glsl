// Counter-based random numbers: pcg4d of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".
// Twin: src/scene/random.rs.
uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Four uniform numbers in [0, 1), of 24 bits each.
vec4 random4(uint seed, uint stream, uint index, uint draw) {
    return vec4(pcg4d(uvec4(seed, stream, index, draw)) >> 8u) * 5.9604644775390625e-8;
}

// Three normal numbers from four random words: Box and Muller.
vec3 normal3(uvec4 words) {
    vec4 u = vec4(words >> 8u) * 5.9604644775390625e-8;
    vec2 radius = sqrt(-2.0 * log(1.0 - u.xz)), turn = 6.283185307179586 * u.yw;
    return vec3(radius.x * cos(turn.x), radius.x * sin(turn.x), radius.y * cos(turn.y));
}
