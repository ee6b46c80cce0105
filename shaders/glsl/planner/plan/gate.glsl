// When a point counts as in a camera's picture. Twin: src/planner/plan/gate.rs.

const uint HARD_CONE = 0, SOFT_CONE = 1, HARD_FRUSTUM = 2, SOFT_FRUSTUM = 3;
layout(constant_id = 2) const uint GATE = SOFT_CONE;

struct Gate {
    float open;       // m in [0, 1]
    vec3 by_view;     // gradient of log m by the unit direction from the camera to the probe
    vec3 by_direction;// gradient of log m by the camera's viewing direction
};

#include "shared/sigmoid.glsl"

// Does a camera see what lies along unit direction `v` from it?
Gate gate(vec3 v, CameraState camera, float softness) {
    vec3 r = camera.direction;
    Gate g = Gate(0.0, vec3(0.0), vec3(0.0));
    if (GATE == HARD_CONE || GATE == SOFT_CONE) {
        // The cone inscribed in the image.
        float tangent = min(camera.tan_x, camera.tan_y);
        float margin = dot(r, v) - inversesqrt(1.0 + tangent * tangent);
        if (GATE == HARD_CONE) {
            g.open = margin >= 0.0 ? 1.0 : 0.0;
            return g;
        }
        g.open = sigmoid(margin / softness);
        // 1 - m cancels in float32 where the gate is nearly open, and Adam would make full steps of what is left.
        float slope = sigmoid(-margin / softness) / softness;
        g.by_view = slope * r;
        g.by_direction = slope * v;
        return g;
    }
    // Image axes of a camera whose roll keeps the scene's up (+Z here) upright.
    vec3 up = vec3(0.0, 0.0, 1.0);
    vec3 side = cross(r, up);
    float k = length(side);
    vec3 x_axis = k > 1e-4 ? side / k : vec3(1.0, 0.0, 0.0);
    vec3 y_axis = cross(r, x_axis);
    float x = dot(v, x_axis), y = dot(v, y_axis), z = dot(v, r);
    // Sines of the angles to the frustum's nearest side planes.
    float norm_x = inversesqrt(1.0 + camera.tan_x * camera.tan_x), norm_y = inversesqrt(1.0 + camera.tan_y * camera.tan_y);
    float margin_x = (camera.tan_x * z - abs(x)) * norm_x, margin_y = (camera.tan_y * z - abs(y)) * norm_y;
    if (GATE == HARD_FRUSTUM) {
        g.open = min(margin_x, margin_y) >= 0.0 ? 1.0 : 0.0;
        return g;
    }
    float open_x = sigmoid(margin_x / softness), open_y = sigmoid(margin_y / softness);
    g.open = open_x * open_y;
    float slope_x = norm_x * sigmoid(-margin_x / softness) / softness;
    float slope_y = norm_y * sigmoid(-margin_y / softness) / softness;
    float by_x = x < 0.0 ? slope_x : -slope_x, by_y = y < 0.0 ? slope_y : -slope_y;
    float by_z = camera.tan_x * slope_x + camera.tan_y * slope_y;
    g.by_view = by_x * x_axis + by_y * y_axis + by_z * r;
    // x and y turn with r through the axes: d x_axis = (I - x x^T)(dr x up)/k, d y_axis = dr x x_axis + r x d x_axis.
    vec3 turn = by_x * v + by_y * cross(v, r);
    turn -= dot(turn, x_axis) * x_axis;
    g.by_direction = by_z * v + by_y * cross(x_axis, v) + cross(up, turn) / max(k, 1e-4);
    return g;
}
