// Push constants of the stages that make one picture.
layout(push_constant) uniform Push {
    // From one plane of parameters to the next: the most Gaussians there can be.
    uint stride;
    uint view;
    // Degree of the harmonics that take part.
    uint degree;
    // Capacity for instances.
    uint capacity;
    vec3 background;
    uint iteration;
};
