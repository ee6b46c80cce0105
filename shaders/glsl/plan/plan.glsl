// What the stages of the planner share: structs (twins in src/plan/shared.rs), specialisation constants, and the
// formulae of gate, kernel and region. Lengths are in units of the region's bounding radius.

layout(constant_id = 0) const uint RESOLUTION = 16;  // texels of a point camera along a side
const uint HARD_CONE = 0, SOFT_CONE = 1, HARD_FRUSTUM = 2, SOFT_FRUSTUM = 3;
layout(constant_id = 2) const uint GATE = SOFT_CONE;
const uint ANGULAR = 0, METRIC = 1;
layout(constant_id = 3) const uint KERNEL = ANGULAR;
layout(constant_id = 4) const bool OCCLUSION = true;  // whether surfaces hide

const uint TEXELS = RESOLUTION * RESOLUTION;
const uint NONE = 0xffffffffu;

// A kernel is cut off where its exponent passes this: exp(-8) = 0.0003 of its peak.
const float KERNEL_CUTOFF = 8.0;
// A soft gate that lets less than this through is closed.
const float GATE_CUTOFF = 1e-4;

struct Settings {
    uint splats;          // kept and planned
    uint kept;            // the first so many never move
    uint probes;          // point cameras a step
    uint pool;            // point cameras in all
    uint capacity;        // capacity in visible splats of a probe (dense), or pairs in all (binned)
    uint row;             // partials from one block of a probe to the next (dense: capacity; binned: 0)
    uint instances;       // capacity in (tile, splat) instances (binned)
    uint iterations;
    uint round_length;    // iterations a view in the iterative variant, 0 in the joint one
    uint seed;
    uint relocate_every;  // 0 for never
    uint relocate_until;
    uint blocks;          // blocks of texels that a probe's tallies and partials come in
    uint weighted;        // 0: every target is 1 (no VDS)
    uint equal;           // 1: every probe weighs the same, 0: by its reachable directions
    float alpha;
    float gate_softness;
    float lr_position;
    float lr_direction;
    float lr_scale;
    float decay;          // of the rates, over the whole run
    float lambda_reg;
    float lambda_bound;
    float lambda_scale;
    float scale_floor;
    float link_angle;     // widest angle between neighbours, 0 where none is asked for
};

// What changes from one iteration to the next; written by the update alone, at its end.
struct Control {
    uint iteration;
    uint halt;        // nothing is done any more
    uint first;       // splats [first, live) move, [0, live) are seen
    uint live;
    uint step;        // of Adam, from 1
    float rate;       // factor on the learning rates
    float log_scale;
    float scale_mean; // Adam's moments of log_scale
    float scale_square;
    uint most_visible; // splats that any probe has seen so far
};

struct Splat {
    vec3 centre;
    float tan_x;  // of half the horizontal field of view
    vec3 direction;
    float tan_y;  // of half the vertical one
};

#include "shared/probe.glsl"

// Gradient of the loss by a splat's pose, of one probe or of all.
struct Gradient {
    vec3 centre;
    float log_scale;
    vec3 direction;
    float utility;    // rise of the loss if the splat were not there
};

// What one block of texels of a probe contributes.
struct Tally {
    float image;      // its part of the image loss
    float log_scale;  // gradient by log s
    float short_fall; // sum over texels of the squared deficit
    float sky;        // texels from whose direction the region sees the probe
    uint visible;     // splats that the probe sees, also past the capacity
    float factor;     // that a viewer's partials are to be multiplied by (viewed.comp)
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

// Sums over the texels of one tile for one splat: the input of `splat_gradient`.
struct InstanceSum {
    vec3 moment;
    float total;
    float log_scale;
    float utility;
    uint spare0;
    uint spare1;
};

struct Gate {
    float open;       // m in [0, 1]
    vec3 by_view;     // gradient of log m by the unit direction from the camera to the probe
    vec3 by_direction;// gradient of log m by the camera's viewing direction
};

// Whether splats are relocated before the iteration that is next.
bool relocation_due(Control c, Settings s) {
    return c.halt == 0 && c.iteration > 0 && c.iteration % s.relocate_every == 0 && c.iteration <= s.relocate_until;
}

// Weight of a texel of a probe in the mean over probes and directions.
float texel_weight(Probe probe, Settings s) {
    float share = 1.0 / (float(TEXELS) * float(s.probes));
    return s.equal != 0 ? share / max(probe.sky, 1.0 / float(TEXELS)) : share;
}

#include "shared/sigmoid.glsl"

// Does a camera see what lies along unit direction `v` from it?
Gate gate(vec3 v, Splat camera, Settings s) {
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
        g.open = sigmoid(margin / s.gate_softness);
        // 1 - m cancels in float32 where the gate is nearly open, and Adam would make full steps of what is left.
        float slope = sigmoid(-margin / s.gate_softness) / s.gate_softness;
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
    float open_x = sigmoid(margin_x / s.gate_softness), open_y = sigmoid(margin_y / s.gate_softness);
    g.open = open_x * open_y;
    float slope_x = norm_x * sigmoid(-margin_x / s.gate_softness) / s.gate_softness;
    float slope_y = norm_y * sigmoid(-margin_y / s.gate_softness) / s.gate_softness;
    float by_x = x < 0.0 ? slope_x : -slope_x, by_y = y < 0.0 ? slope_y : -slope_y;
    float by_z = camera.tan_x * slope_x + camera.tan_y * slope_y;
    g.by_view = by_x * x_axis + by_y * y_axis + by_z * r;
    // x and y turn with r through the axes: d x_axis = (I - x x^T)(dr x up)/k, d y_axis = dr x x_axis + r x d x_axis.
    vec3 turn = by_x * v + by_y * cross(v, r);
    turn -= dot(turn, x_axis) * x_axis;
    g.by_direction = by_z * v + by_y * cross(x_axis, v) + cross(up, turn) / max(k, 1e-4);
    return g;
}

// Exponent of the kernel of a splat at distance `d` along unit direction `n`, seen along `w`; the kernel is exp(-x).
float kernel_exponent(vec3 w, vec3 n, float d, float inverse_scale_square) {
    if (KERNEL == ANGULAR) {
        // 1 - w.n cancels in float32; half the squared chord does not.
        vec3 chord = w - n;
        return 0.5 * dot(chord, chord) * inverse_scale_square;
    }
    float h = dot(w, n);
    vec3 off = n - h * w;
    return h > 0.0 ? 0.5 * d * d * dot(off, off) * inverse_scale_square : 1e30;
}

// Gradient of the loss by the splat's centre and direction, from the sums over texels: `moment` is the sum of
// (dL/da) a w, `total` that of (dL/da) a; with the metric kernel `moment` carries a factor w.(u - p).
Gradient splat_gradient(vec3 n, float d, Gate g, vec3 moment, float total, float inverse_scale_square) {
    Gradient grad = Gradient(vec3(0.0), 0.0, vec3(0.0), 0.0);
    vec3 by_n = -total * g.by_view;
    if (KERNEL == ANGULAR) {
        by_n += moment * inverse_scale_square;
        grad.centre = (by_n - dot(by_n, n) * n) / d;
    } else {
        grad.centre = (by_n - dot(by_n, n) * n) / d - inverse_scale_square * (total * d * n - moment);
    }
    grad.direction = total * g.by_direction;
    return grad;
}
