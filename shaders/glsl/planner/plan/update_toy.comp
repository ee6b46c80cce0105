#version 450
#extension GL_GOOGLE_include_directive : require
// A third objective, for a test of what an objective has to bring: cameras come to a place, by the squared distance.
// Twin: src/planner/plan/objective_tests.rs.
#include "planner/plan/update.glsl"
layout(push_constant) uniform Push { vec3 place; };

void begin() {}

void gather(uint j, CameraState splat, Settings s, Control c, uint thread, inout Gradient sum, inout float penalty) {
    if (thread != 0) return;
    vec3 off = splat.centre - place;
    sum.centre += 2.0 * off;
    penalty += dot(off, off);
}

vec2 own_sums(uint thread) {
    return vec2(0.0);
}

float own_step(Control c, float own) {
    return 0.0;
}
