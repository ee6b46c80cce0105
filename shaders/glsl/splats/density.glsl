// What the stages of adaptive density control share (Kerbl et al. 2023, "3D Gaussian Splatting", section 5.2). Gaussians that
// are removed leave free slots, which children fill before they are put behind the others: nothing has to move.

layout(push_constant) uniform Push {
    // From one plane of parameters to the next: the most Gaussians there can be.
    uint stride;
    // Planes that parameters and moments have.
    uint planes;
    uvec2 seed;
    uint iteration;
    // Mean length of the gradient by the mean, in halves of a picture, from which a Gaussian is too coarse.
    float coarse;
    // Standard deviation from which it is split and not cloned, and from which it is removed.
    float wide;
    float too_wide;
    // Opacity under which it is removed.
    float least;
};

// Logit of the opacity of a free slot; whatever lies below counts as one.
const float FREE = -100.0;

bool is_free(float logit) {
    return logit < 0.5 * FREE;
}
