#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Gaussian splatting, 1: every Gaussian as the view sees it, and the key that it is sorted by: its depth.
#include "shared/group.glsl"
#include "splats/gaussian.glsl"
#include "splats/frame.glsl"
#include "splats/harmonics.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) readonly buffer Parameters { float parameters[]; };
layout(binding = 3, std430) writeonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 4, std430) writeonly buffer DepthKeys { uint depth_keys[]; };
layout(binding = 5, std430) writeonly buffer DepthSplats { uint depth_splats[]; };

float value(uint plane, uint i) {
    return parameters[plane * stride + i];
}

vec3 vector(uint plane, uint i) {
    return vec3(value(plane, i), value(plane + 1, i), value(plane + 2, i));
}

// The picture of Gaussian `i`; of no opacity where it is not seen.
Projected project(View view, uint i) {
    Projected none = Projected(vec2(0.0), 0.0, 0.0, vec3(0.0), 0.0, vec3(0.0), 0);
    vec3 centre = vector(CENTRE, i), p = to_camera(view, centre);
    if (!(p.z >= view.near)) return none;
    float opacity = sigmoid(value(OPACITY, i));
    if (!(opacity >= MIN_ALPHA)) return none;
    vec4 q = vec4(value(ROTATION, i), value(ROTATION + 1, i), value(ROTATION + 2, i), value(ROTATION + 3, i));
    vec3 scale = exp(vector(LOG_SCALE, i));
    mat3 axes = rotation_of(normalize(q)) * mat3(scale.x, 0.0, 0.0, 0.0, scale.y, 0.0, 0.0, 0.0, scale.z);
    vec3 m[2];
    linearised(view, p, clamped_ray(view, p), m);
    Spread spread = spread_of(m[0] * axes, m[1] * axes);
    // Neither negative nor infinite, nor no number at all.
    if (!(spread.determinant > 0.0 && spread.determinant < 1e38)) return none;
    if (ANTIALIASED) {
        opacity *= compensation(spread);
        if (!(opacity >= MIN_ALPHA)) return none;
    }
    vec3 covariance = spread.narrow + vec3(low_pass(), 0.0, low_pass());
    vec2 mean = view.focal * p.xy / p.z + view.principal;
    // The ellipse on which alpha falls to its least value, against the picture.
    vec2 half_extent = sqrt(2.0 * log(opacity / MIN_ALPHA) * covariance.xz);
    vec2 size = vec2(view.width, view.height);
    if (any(lessThan(mean + half_extent, vec2(0.0))) || any(greaterThan(mean - half_extent, size))) return none;

    float b[16];
    harmonics(normalize(centre - view.position), b);
    vec3 colour = vec3(0.5);
    uint terms = (degree + 1) * (degree + 1);
    [[unroll]] for (uint k = 0; k < 16; ++k) {
        if (k < terms) colour += b[k] * vector(HARMONICS + 3 * k, i);
    }
    vec3 conic = vec3(covariance.z, -covariance.y, covariance.x) / spread.determinant;
    return Projected(mean, p.z, opacity, conic, 1.0 / spread.determinant, max(colour, 0.0), 0);
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex;
    if (i >= population[0]) return;
    Projected splat = project(views[view], i);
    projected[i] = splat;
    // Depths are positive, so that their bits sort as they do. What is not seen goes last.
    depth_keys[i] = splat.opacity > 0.0 ? floatBitsToUint(splat.depth) : 0x7fffffffu;
    depth_splats[i] = i;
}
