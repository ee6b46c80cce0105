// What the stages of the paper's objective share: structs (twins in src/planner/plan/paper/shared.rs), specialisation constants and the
// formulae of the kernel.
#include "planner/plan/gate.glsl"
#include "shared/probe.glsl"

layout(constant_id = 0) const uint RESOLUTION = 16;  // texels of a point camera along a side
const uint ANGULAR = 0, METRIC = 1;
layout(constant_id = 3) const uint KERNEL = ANGULAR;
layout(constant_id = 4) const bool OCCLUSION = true;  // whether surfaces hide

const uint TEXELS = RESOLUTION * RESOLUTION;

// A kernel is cut off where its exponent passes this: exp(-8) = 0.0003 of its peak.
const float KERNEL_CUTOFF = 8.0;
// A soft gate that lets less than this through is closed.
const float GATE_CUTOFF = 1e-4;

struct PaperSettings {
    uint probes;          // point cameras a step
    uint pool;            // point cameras in all
    uint capacity;        // capacity in visible splats of a probe (dense), or pairs in all (binned)
    uint row;             // partials from one block of a probe to the next (dense: capacity; binned: 0)
    uint instances;       // capacity in (tile, splat) instances (binned)
    uint blocks;          // blocks of texels that a probe's tallies and partials come in
    uint seed;
    uint relocate_every;  // 0 for never
    uint relocate_until;
    uint weighted;        // 0: every target is 1 (no VDS)
    uint equal;           // 1: every probe weighs the same, 0: by its reachable directions
    float alpha;
    float gate_softness;
    float lr_scale;
    float lambda_reg;
    float lambda_scale;
    float scale_floor;
};

// The scale that all splats share, with Adam's moments of its logarithm; written at the end of an iteration alone.
struct Scale {
    float log_scale;
    float mean;
    float square;
};

// What one block of texels of a probe contributes.
struct Tally {
    float image;      // its part of the image loss
    float log_scale;  // gradient by log s
    float short_fall; // sum over texels of the squared deficit
    float sky;        // texels from whose direction the region sees the probe
    uint visible;     // splats that the probe sees, also past the capacity; not counted by the binned pass
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

// Whether splats are relocated before the iteration that is next.
bool relocation_due(Control c, PaperSettings p) {
    return c.halt == 0 && c.iteration > 0 && c.iteration % p.relocate_every == 0 && c.iteration <= p.relocate_until;
}

// Weight of a texel of a probe in the mean over probes and directions.
float texel_weight(Probe probe, PaperSettings p) {
    float share = 1.0 / (float(TEXELS) * float(p.probes));
    return p.equal != 0 ? share / max(probe.sky, 1.0 / float(TEXELS)) : share;
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
