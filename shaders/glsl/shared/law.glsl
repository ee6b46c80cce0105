// The law of expected error (twin: src/planner/quality/law.rs): the logarithm of the squared error of trained splats at a
// look, beside what the material itself makes of it, from the angles and distances of the nearest views that see the point.
struct Law {
    vec3 angle;      // by the angle of the first, second and third nearest view, in radians
    float farther;   // by the logarithm of the nearest one's distance over the viewer's, where it is farther away
    float background;  // weight of a look beside the surface of an object
    float spare0;
    float spare1;
    float spare2;
};

// `angles` as the views come, `log_ratio` of the nearest.
float law_at(Law law, vec3 angles, float log_ratio) {
    return dot(law.angle, angles) + law.farther * max(log_ratio, 0.0);
}
