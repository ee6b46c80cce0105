// A point camera, lifted off the surface, in the planner's frame. Twin: src/visibility/probe_depth.rs.
struct Probe {
    vec3 position;
    float score;       // view dependency, in [1, 2]
    float sky;         // fraction of directions from which the region sees it
    uint spare0;
    uint spare1;
    uint spare2;
};
