// A point camera, lifted off the surface, in the planner's frame. Twin: src/visibility/probe_depth.rs.
struct Probe {
    vec3 position;
    float score;       // view dependency, in [1, 2]
    vec3 normal;       // of the side from which it can be seen; zero where the surface itself is in the way
    float sky;         // fraction of directions from which the region sees it
};

// Is unit direction `w` on the side from which the probe can be seen? A disc hides no more than itself, and a cloud of
// them has gaps: what is behind one must not be seen through the next.
bool faces(Probe probe, vec3 w) {
    return dot(probe.normal, w) >= 0.0;
}
