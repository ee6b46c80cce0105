#version 450
#extension GL_GOOGLE_include_directive : require
// The end of an iteration where the expected error of viewers is minimised: each look left three partials (viewed.comp),
// each of the splat that its slot names, and its viewer's loss has the factor of all of them.
#include "planner/plan/update.glsl"
#include "planner/plan/expected_quality/settings.glsl"
layout(binding = 13, std430) readonly buffer ViewerLosses { ViewerLoss viewer_losses[]; };
layout(binding = 14, std430) readonly buffer AnchorStarts { uint anchor_starts[]; };
#include "planner/plan/expected_quality/links.glsl"
layout(binding = 15, std430) readonly buffer Anchors { Anchor anchors[]; };
layout(binding = 16, std430) readonly buffer QualityBlock { QualitySettings quality[]; };

const uint AHEAD = 15;  // slots of a thread that are read at once

QualitySettings q;

void begin() {
    q = quality[0];
}

void gather(uint j, CameraState splat, Settings s, Control c, uint thread, inout Gradient sum, inout float penalty) {
    uint count = q.viewers * 192;
    for (uint first = thread; first < count; first += AHEAD * THREADS) {
        // Loads that wait for memory together.
        uint owners[AHEAD];
        for (uint i = 0; i < AHEAD; ++i) owners[i] = first + i * THREADS < count ? slots[first + i * THREADS] : NONE;
        for (uint i = 0; i < AHEAD; ++i) {
            if (owners[i] != j) continue;
            uint r = first + i * THREADS;
            float factor = viewer_losses[r / 192].factor;
            sum.centre += factor * partials[r].centre;
            sum.direction += factor * partials[r].direction;
        }
    }
    float widest = q.link_angle;
    if (j < s.kept || widest <= 0.0) return;
    for (uint k = anchor_starts[j] + thread; k < anchor_starts[j + 1]; k += THREADS) {
        add_link(anchors[k], splat, widest, sum, penalty);
    }
}

vec2 own_sums(uint thread) {
    float sum = 0.0;
    for (uint i = thread; i < q.viewers; i += THREADS) sum += viewer_losses[i].loss;
    return vec2(sum, 0.0);
}

float own_step(Control c, float own) {
    return 0.0;
}
