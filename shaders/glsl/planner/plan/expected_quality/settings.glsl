// What the stages of expected quality share; twins in src/planner/plan/expected_quality/shared.rs.

struct QualitySettings {
    uint viewers;         // an iteration
    float gate_softness;
    float link_angle;     // widest angle between neighbours, 0 where none is asked for
};

// What a viewer's looks contribute.
struct ViewerLoss {
    float loss;    // its part of the loss
    float factor;  // that its partials are to be multiplied by
};
