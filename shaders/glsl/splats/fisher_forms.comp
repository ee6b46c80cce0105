#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Fisher information, 1: how every pixel of a picture answers to the shape and the place of each Gaussian. The derivatives of
// the projection, parameter by parameter: squares over pixels cannot be carried back as sums can.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/harmonics.glsl"
#include "splats/fisher.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) readonly buffer Parameters { float parameters[]; };
layout(binding = 3, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 4, std430) writeonly buffer Forms { Form forms[]; };

vec3 vector(uint plane, uint i) {
    return vec3(parameters[plane * stride + i], parameters[(plane + 1) * stride + i], parameters[(plane + 2) * stride + i]);
}

// The form of a parameter by which the summed colour changes as `weight`, the mean as `mean`, and the axes in the picture,
// which are `x` and `y`, as `by_x` and `by_y`.
Form form_of(vec3 x, vec3 y, Spread spread, vec3 conic, float weight, vec2 mean, vec3 by_x, vec3 by_y) {
    vec3 covariance = vec3(2.0 * dot(x, by_x), dot(x, by_y) + dot(by_x, y), 2.0 * dot(y, by_y));
    mat2 inverse = mat2(conic.x, conic.y, conic.y, conic.z);
    mat2 by_conic = -inverse * mat2(covariance.x, covariance.y, covariance.y, covariance.z) * inverse;
    float constant = 0.0;
    if (ANTIALIASED) {
        // Of the compensation, relative to it.
        float sharp = 2.0 * dot(cross(x, y), cross(by_x, y) + cross(x, by_y));
        float determinant = sharp + low_pass() * (covariance.x + covariance.z);
        constant = 0.5 * (sharp / spread.sharp - determinant / spread.determinant);
    }
    vec3 quadratic = -vec3(0.5 * by_conic[0][0], by_conic[0][1], 0.5 * by_conic[1][1]);
    return Form(weight, constant, inverse * mean, quadratic, 0.0);
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= population[0] || !(projected[i].opacity > 0.0)) return;
    View camera = views[view];
    Projected splat = projected[i];
    vec3 centre = vector(CENTRE, i), p = to_camera(camera, centre);
    vec4 q = vec4(vector(ROTATION, i), parameters[(ROTATION + 3) * stride + i]);
    vec3 scale = exp(vector(LOG_SCALE, i));
    mat3 axes = rotation_of(normalize(q)) * mat3(scale.x, 0.0, 0.0, 0.0, scale.y, 0.0, 0.0, 0.0, scale.z);
    vec2 ray = clamped_ray(camera, p), through = p.xy / p.z;
    vec3 m[2];
    linearised(camera, p, ray, m);
    vec3 x = m[0] * axes, y = m[1] * axes;
    Spread spread = spread_of(x, y);

    [[unroll]] for (uint k = 0; k < 3; ++k) {
        vec3 by_x = vec3(0.0), by_y = vec3(0.0);
        by_x[k] = x[k];
        by_y[k] = y[k];
        forms[FORMS * i + k] = form_of(x, y, spread, splat.conic, 0.0, vec2(0.0), by_x, by_y);
    }

    // The colour changes with the direction that the centre is seen in.
    vec3 towards = centre - camera.position;
    float far = max(length(towards), 1e-12);
    vec3 direction = towards / far, lit = vec3(greaterThan(splat.colour, vec3(0.0))), by_direction = vec3(0.0);
    uint terms = (degree + 1) * (degree + 1);
    for (uint k = 1; k < terms; ++k) by_direction += harmonic_gradient(k, direction) * dot(vector(HARMONICS + 3 * k, i), lit);
    vec3 weights = (by_direction - direction * dot(direction, by_direction)) / far;

    [[unroll]] for (uint k = 0; k < 3; ++k) {
        vec3 moved = vec3(camera.row_x[k], camera.row_y[k], camera.row_z[k]);
        vec2 by_through = (moved.xy - through * moved.z) / p.z, by_ray = by_through * vec2(equal(ray, through));
        vec3 by_m0 = -moved.z / p.z * m[0] - camera.focal.x / p.z * by_ray.x * camera.row_z.xyz;
        vec3 by_m1 = -moved.z / p.z * m[1] - camera.focal.y / p.z * by_ray.y * camera.row_z.xyz;
        forms[FORMS * i + 3 + k] =
            form_of(x, y, spread, splat.conic, weights[k], camera.focal * by_through, by_m0 * axes, by_m1 * axes);
    }
}
