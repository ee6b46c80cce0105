// How the pose of a camera is corrected: it is turned about its own place by Exp(value[0..3]), a rotation vector in world axes, and moved by
// value[3..6]. Twin: src/splats/pose.rs.

// Of a view: the correction, Adam's two means, and its steps so far.
struct PoseState {
    float value[6];
    float first[6];
    float second[6];
    float steps;
    float spare0;
};

// Numbers of a correction.
const uint LEARNT = 6;
// Gaussians that a workgroup of the first stage sums.
const uint PER_GROUP = 1024;
