// A camera: position and image axes scaled by the inverse tangents of the half fields of view.
struct View {
    vec3 position;
    float focal;       // pixels
    vec3 forward;
    float cone_cos;
    vec3 right;
    float spare0;
    vec3 down;
    float spare1;
};
