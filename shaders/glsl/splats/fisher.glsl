// How a pixel answers to a parameter of a Gaussian. With w = alpha T, q = dL/da a for L = red + green + blue and d from the mean
// to the pixel, dL by the parameter is w weight + q (constant + linear.d + quadratic.(dx^2, dx dy, dy^2)).
struct Form {
    float weight;
    float constant;
    vec2 linear;
    vec3 quadratic;
    float spare0;
};

// Forms of a Gaussian: of its logarithms of standard deviations, then of its centre.
const uint FORMS = 6;
// Sums of squares over pixels: of w, of q, of every form.
const uint SQUARES = 2 + FORMS;
