// What a viewer's pixel shows, in the planner's frame: a point of the surface, or, beside an object, the empty place where its
// ray passes the object's middle, since trained splats must leave nothing there. Twin: src/planner/quality/look.rs.
struct Look {
    vec3 position;   // of the surface point, lifted off the surface on the viewer's side
    float distance;  // from there to the viewer; 0 where the look counts for nothing
    vec3 direction;  // unit, from the point to the viewer
    float footprint; // of the viewer's picture at the point: distance times the tangent of half its wider field of view
    vec3 normal;     // unit, of the surface on the viewer's side; zero in empty space
    float weight;    // of the look in its viewer's mean: 1 on the surface
};

// Views at least so far from a viewer's direction, in radians, count as none: src/planner/quality/nearest.rs.
const float FARTHEST = 2.0;

#include "shared/angle.glsl"
