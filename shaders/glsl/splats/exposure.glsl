// How a photo was exposed and balanced: with what splats show before the background, c, and what is left of the light, T, the picture is
// shown = A c + (1 - T) b + T background. Twin: src/splats/exposure.rs.

// Of a view: A without the unit matrix and b, row by row (three of A, one of b), Adam's two means, and its steps so far.
struct ExposureState {
    float value[12];
    float first[12];
    float second[12];
    float steps;
    float spare0;
    float spare1;
    float spare2;
};

// Column k of the result is row k of A.
mat3 rows_of(ExposureState state) {
    mat3 rows = mat3(1.0);
    for (uint r = 0; r < 3; ++r) rows[r] += vec3(state.value[4 * r], state.value[4 * r + 1], state.value[4 * r + 2]);
    return rows;
}

vec3 offset_of(ExposureState state) {
    return vec3(state.value[3], state.value[7], state.value[11]);
}
