// What structure from motion needs of neighbours, as a penalty: points that two of them share lie in the pictures of both,
// and are seen at no wide angle between the two. Twin: src/planner/plan/expected_quality/links.rs.

#include "shared/angle.glsl"

// A point that a camera shares with a neighbour.
struct Anchor {
    vec3 point;
    float weight;
    vec3 other;   // where the neighbour stood when the links were made: it may move while this is read
    uint spare;
};

const float KNEE = 0.05;          // radians from which on the penalty is linear (Huber 1964)
const float WITHIN_ANGLE = 0.9;   // part of the widest angle that costs nothing
const float WITHIN_PICTURE = 0.8; // part of the inscribed cone's half angle that costs nothing

// Huber's loss of an angle past what costs nothing, and its slope.
vec2 past(float x) {
    if (x <= 0.0) return vec2(0.0);
    return x < KNEE ? vec2(0.5 * x * x / KNEE, x / KNEE) : vec2(x - 0.5 * KNEE, 1.0);
}

// Adds the gradient of the penalty on a splat by an anchor of it to `sum`, and its value to `penalty`.
void add_link(Anchor anchor, CameraState splat, float widest, inout Gradient sum, inout float penalty) {
    float half_cone = atan(min(splat.tan_x, splat.tan_y));
    vec3 ray = anchor.point - splat.centre;
    float d = max(length(ray), 1e-6);
    vec3 n = ray / d, m = normalize(anchor.point - anchor.other);
    float parallax_cosine = dot(n, m), off_cosine = dot(n, splat.direction);
    vec2 parallax = anchor.weight * past(angle_between(n, m) - WITHIN_ANGLE * widest);
    vec2 off = anchor.weight * past(angle_between(n, splat.direction) - WITHIN_PICTURE * half_cone);
    penalty += parallax.x + off.x;
    // An angle changes by minus its cosine's change over its sine.
    float by_parallax = parallax.y * inversesqrt(max(1.0 - parallax_cosine * parallax_cosine, 1e-8));
    float by_off = off.y * inversesqrt(max(1.0 - off_cosine * off_cosine, 1e-8));
    vec3 by_n = by_parallax * m + by_off * splat.direction;
    sum.centre += (by_n - dot(by_n, n) * n) / d;
    sum.direction -= by_off * n;
}
