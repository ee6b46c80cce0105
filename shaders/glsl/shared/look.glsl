// What a viewer's pixel shows, in the planner's frame. Twin: src/quality/look.rs.
struct Look {
    vec3 position;   // of the surface point, lifted off the surface on the viewer's side
    float distance;  // from there to the viewer; 0 where the pixel shows no surface
    vec3 direction;  // unit, from the point to the viewer
    uint viewer;     // by its place in the pool
    vec3 normal;     // unit, of the surface on the viewer's side
    uint spare0;
};
