// What the stages of relocation share (Kheradmand et al. 2024, "3D Gaussian Splatting as Markov Chain Monte Carlo").

layout(push_constant) uniform Push {
    // From one plane of parameters to the next.
    uint stride;
    // Planes that parameters and moments have.
    uint planes;
    // Gaussians before and after.
    uint before;
    uint after;
    uvec2 seed;
    uint iteration;
    // Weights are opacities in steps of 1 / steps, so that all of them together fit a word.
    uint steps;
    // Opacity up to which a Gaussian is dead.
    float least;
};

const uint NONE = 0xffffffffu;
