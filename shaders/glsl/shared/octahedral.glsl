// Equal-area octahedral map of the sphere (Clarberg 2008, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD").
// Every texel of an R x R image has solid angle 4 pi / R^2. Twin: src/scene/octahedral.rs.

// Unit direction at `square` in [-1, 1]^2.
vec3 octahedral_direction(vec2 square) {
    vec2 a = abs(square);
    float d = 1.0 - (a.x + a.y);
    float r = 1.0 - abs(d);
    float phi = r == 0.0 ? 0.0 : 0.78539816339 * ((a.y - a.x) / r + 1.0);
    float f = r * sqrt(2.0 - r * r);
    vec2 side = vec2(square.x < 0.0 ? -1.0 : 1.0, square.y < 0.0 ? -1.0 : 1.0);
    return vec3(f * cos(phi) * side.x, f * sin(phi) * side.y, d < 0.0 ? r * r - 1.0 : 1.0 - r * r);
}

// The texel, row-major, of an R x R image in which unit direction `n` falls.
uint octahedral_texel(vec3 n, uint resolution) {
    float r = sqrt(max(1.0 - abs(n.z), 0.0));
    float phi = (n.x == 0.0 && n.y == 0.0) ? 0.0 : atan(abs(n.y), abs(n.x)) * 0.63661977237;
    vec2 square = vec2(r - phi * r, phi * r);
    if (n.z < 0.0) square = 1.0 - square.yx;
    square *= vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    uvec2 texel = min(uvec2(max(0.5 * square + 0.5, 0.0) * float(resolution)), uvec2(resolution - 1));
    return texel.y * resolution + texel.x;
}

vec3 octahedral_texel_centre(uint texel, uint resolution) {
    vec2 at = vec2(float(texel % resolution) + 0.5, float(texel / resolution) + 0.5);
    return octahedral_direction(2.0 * at / float(resolution) - 1.0);
}
