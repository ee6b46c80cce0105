// The law of expected error (twin: src/planner/quality/law.rs): the squared error of trained splats at a look, beside what the material
// itself makes of it, from the angles of the nearest views that see the point and the footprint of the nearest one's picture.
struct Law {
    vec3 angle;        // by the angle of the first, second and third nearest view, in radians
    float farther;     // by the logarithm of the nearest one's footprint over the viewer's, where it is larger
    float background;  // weight of a look beside the surface of an object
    float most;        // logarithm of the error that it never reaches
    float spare0;
    float spare1;
};

// `angles` as the views come, `log_ratio` of the nearest.
float law_error(Law law, vec3 angles, float log_ratio) {
    float rise = dot(law.angle, angles) + law.farther * max(log_ratio, 0.0);
    return 1.0 / (exp(-rise) + exp(-law.most));
}

// How fast the error `error` rises with what it rises by.
float law_slope(Law law, float error) {
    return error * (1.0 - error * exp(-law.most));
}
