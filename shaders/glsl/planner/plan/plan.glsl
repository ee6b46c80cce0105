// What the stages of every plan share, whatever its objective: structs, whose twins are in src/planner/plan/shared.rs. Lengths are in units of
// the region's bounding radius.

const uint NONE = 0xffffffffu;

struct Settings {
    uint splats;          // kept and planned
    uint kept;            // the first so many never move
    uint iterations;
    uint round_length;    // iterations a view where they are added one at a time, 0 where all move at once
    float lr_position;
    float lr_direction;
    float decay;          // of the rates, over the whole run
    float lambda_bound;
};

// What changes from one iteration to the next; written by the update alone, at its end.
struct Control {
    uint iteration;
    uint halt;        // nothing is done any more
    uint first;       // splats [first, live) move, [0, live) are seen
    uint live;
    uint step;        // of Adam, from 1
    float rate;       // factor on the learning rates
};

struct CameraState {
    vec3 centre;
    float tan_x;  // of half the horizontal field of view
    vec3 direction;
    float tan_y;  // of half the vertical one
};

// Gradient of the loss by a splat's pose, or a part of it.
struct Gradient {
    vec3 centre;
    float own;        // by a number that the objective learns beside the poses
    vec3 direction;
    float utility;    // rise of the loss if the splat were not there, where the objective knows it
};

// Adam's first and second moments of a splat's pose.
struct Moments {
    vec3 centre_mean;
    uint spare0;
    vec3 centre_square;
    uint spare1;
    vec3 direction_mean;
    uint spare2;
    vec3 direction_square;
    float utility;    // running mean, decay 0.9
};
