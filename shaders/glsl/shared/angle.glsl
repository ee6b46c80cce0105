// Angle between unit vectors, exact for small angles where acos is not.
float angle_between(vec3 a, vec3 b) {
    return 2.0 * asin(min(0.5 * length(a - b), 1.0));
}
