#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
// Gaussian splatting, 6: every Gaussian sums its instances' gradients, in order, carries it back through the projection to its
// parameters, and takes a step of Adam. The exploration noise of 3DGS-MCMC (Kheradmand et al. 2024) follows at once.
#include "shared/adam.glsl"
#include "shared/fold.glsl"
#include "shared/group.glsl"
#include "shared/random.glsl"
#include "splats/harmonics.glsl"
#include "splats/gaussian.glsl"
#include "splats/sums.glsl"
layout(local_size_x = 64) in;
// Whether adaptive density control needs the length of the gradient by the mean.
layout(constant_id = 1) const bool STATISTICS = false;
// Whether the backward pass has summed the instances already, by atomic additions.
layout(constant_id = 2) const bool SUMMED = false;
// Whether the gradient by the camera's pose is wanted.
layout(constant_id = 3) const bool POSES = false;
// Whether Gaussians stay as they are: a pose alone is learnt.
layout(constant_id = 4) const bool FROZEN = false;

layout(push_constant) uniform Push {
    uint stride;
    uint view;
    uint degree;
    uint iteration;
    uvec2 seed;
    // Adam's rates, and the corrections of its moments for their start at zero.
    float centre_rate;
    float scale_rate;
    float rotation_rate;
    float opacity_rate;
    float colour_rate;
    float harmonics_rate;
    float first_correction;
    float second_correction;
    // Weights of the mean opacity and the mean standard deviation in the loss.
    float opacity_weight;
    float scale_weight;
    // Factor of the noise.
    float noise;
};

layout(binding = 0, std430) readonly buffer Views { View views[]; };
layout(binding = 1, std430) readonly buffer Population { uint population[]; };
layout(binding = 2, std430) readonly buffer Control { uint control[]; };
layout(binding = 3, std430) readonly buffer ProjectedBlock { Projected projected[]; };
layout(binding = 4, std430) readonly buffer Runs { uvec2 runs[]; };
layout(binding = 5, std430) readonly buffer Partials { float partials[]; };
layout(binding = 6, std430) restrict buffer Parameters { float parameters[]; };
layout(binding = 7, std430) restrict buffer First { float first[]; };
layout(binding = 8, std430) restrict buffer Second { float second[]; };
// Sum over views of the length of the gradient by the mean, for a picture two units wide and high; and how many views.
layout(binding = 9, std430) buffer Statistics { vec2 statistics[]; };
// In planes: what turning the Gaussian about the camera, with its harmonics, and moving it change in the loss.
layout(binding = 10, std430) writeonly buffer Forces { float forces[]; };

// Instances that a thread sums by itself.
const uint FEW = 32;
const uint NOISE_STREAM = 0x47000000u;

shared uvec2 large[64];
shared uint owner[64];
shared uint large_count;
shared float parts[SUMS][64];

uint at(uint plane, uint i) {
    return plane * stride + i;
}

vec3 vector(uint plane, uint i) {
    return vec3(parameters[at(plane, i)], parameters[at(plane + 1, i)], parameters[at(plane + 2, i)]);
}

// Planes that are stepped together: all of them are loaded before any is stored, so that loads need not wait for one another.
const uint TOGETHER = 12;

// A step of Adam for `count` planes from `plane` on, `values` being what they hold; leaves the new values there.
void adam(uint plane, uint count, uint i, float gradients[TOGETHER], float rates[TOGETHER], inout float values[TOGETHER]) {
    float m[TOGETHER], v[TOGETHER];
    [[unroll]] for (uint k = 0; k < TOGETHER; ++k) {
        if (k < count) {
            m[k] = first[at(plane + k, i)];
            v[k] = second[at(plane + k, i)];
        }
    }
    [[unroll]] for (uint k = 0; k < TOGETHER; ++k) {
        if (k < count) {
            adam_means(gradients[k], m[k], v[k]);
            values[k] -= adam_step(rates[k], m[k], v[k], vec2(first_correction, second_correction), 1e-15);
            first[at(plane + k, i)] = m[k];
            second[at(plane + k, i)] = v[k];
            parameters[at(plane + k, i)] = values[k];
        }
    }
}

// The sums over all instances of this thread's Gaussian; the long ones by the whole workgroup. Uniform control flow.
float[SUMS] gathered(uvec2 run) {
    uint thread = gl_LocalInvocationIndex;
    float sum[SUMS];
    [[unroll]] for (uint c = 0; c < SUMS; ++c) sum[c] = 0.0;
    if (thread == 0) large_count = 0;
    barrier();
    if (run.y > FEW) {
        uint slot = atomicAdd(large_count, 1);
        large[slot] = run;
        owner[slot] = thread;
    } else {
        for (uint k = 0; k < run.y; ++k) {
            [[unroll]] for (uint c = 0; c < SUMS; ++c) sum[c] += partials[SUMS * (run.x + k) + c];
        }
    }
    barrier();
    for (uint slot = 0; slot < large_count; ++slot) {
        float part[SUMS];
        [[unroll]] for (uint c = 0; c < SUMS; ++c) part[c] = 0.0;
        for (uint k = thread; k < large[slot].y; k += 64) {
            [[unroll]] for (uint c = 0; c < SUMS; ++c) part[c] += partials[SUMS * (large[slot].x + k) + c];
        }
        [[unroll]] for (uint c = 0; c < SUMS; ++c) parts[c][thread] = part[c];
        FOLD(thread, 64, [[unroll]] for (uint c = 0; c < SUMS; ++c) parts[c][thread] += parts[c][thread + apart]);
        barrier();
        if (thread == owner[slot]) {
            [[unroll]] for (uint c = 0; c < SUMS; ++c) sum[c] = parts[c][0];
        }
        barrier();
    }
    return sum;
}

// Gradients by the parameters of one Gaussian, but for the harmonics.
struct Gradients {
    vec3 centre;
    vec3 log_scale;
    vec4 rotation;
    float opacity;
    // By a turn of the Gaussian about the camera, as a rotation vector in world axes. What its harmonics show turns with it.
    vec3 turn;
};

// From the gradients by mean, conic and opacity to those by the parameters.
Gradients through_projection(View camera, uint i, vec2 by_mean, vec3 by_conic, float by_opacity) {
    vec3 p = to_camera(camera, vector(CENTRE, i));
    vec4 q = vec4(parameters[at(ROTATION, i)], parameters[at(ROTATION + 1, i)], parameters[at(ROTATION + 2, i)],
        parameters[at(ROTATION + 3, i)]);
    float size = length(q), plain = sigmoid(parameters[at(OPACITY, i)]);
    vec4 unit = q / size;
    vec3 scale = exp(vector(LOG_SCALE, i));
    mat3 turned = rotation_of(unit);
    mat3 axes = turned * mat3(scale.x, 0.0, 0.0, 0.0, scale.y, 0.0, 0.0, 0.0, scale.z);
    vec2 ray = clamped_ray(camera, p);
    vec3 m[2];
    linearised(camera, p, ray, m);
    vec3 x = m[0] * axes, y = m[1] * axes, conic = projected[i].conic;

    // The conic is the covariance's inverse: by_covariance = -conic * by_conic * conic, symmetric, each entry for itself.
    mat2 inverse = mat2(conic.x, conic.y, conic.y, conic.z);
    mat2 by_covariance = -inverse * mat2(by_conic.x, 0.5 * by_conic.y, 0.5 * by_conic.y, by_conic.z) * inverse;
    float by_plain = by_opacity;
    if (ANTIALIASED) {
        Spread spread = spread_of(x, y);
        vec3 narrow = spread.narrow, wide = narrow + vec3(low_pass(), 0.0, low_pass());
        float factor = compensation(spread);
        by_plain *= factor;
        if (factor > 0.0) {
            float by_ratio = by_opacity * plain * 0.5 / (factor * spread.determinant), ratio = factor * factor;
            by_covariance[0][0] += by_ratio * (narrow.z - ratio * wide.z);
            by_covariance[1][1] += by_ratio * (narrow.x - ratio * wide.x);
            float across = -by_ratio * (narrow.y - ratio * wide.y);
            by_covariance[0][1] += across;
            by_covariance[1][0] += across;
        }
    }

    // covariance = (m axes)(m axes)^T, of which the rows are f * (row - ray * row_z) / z.
    vec3 by_x = 2.0 * (by_covariance[0][0] * x + by_covariance[0][1] * y);
    vec3 by_y = 2.0 * (by_covariance[1][0] * x + by_covariance[1][1] * y);
    mat3 by_axes = outerProduct(m[0], by_x) + outerProduct(m[1], by_y);
    vec3 by_m[2] = vec3[](axes * by_x, axes * by_y);
    vec2 by_ray = -camera.focal / p.z * vec2(dot(by_m[0], camera.row_z.xyz), dot(by_m[1], camera.row_z.xyz));
    float by_depth = -(dot(by_m[0], m[0]) + dot(by_m[1], m[1])) / p.z;
    vec2 through = p.xy / p.z;
    vec2 by_through = camera.focal * by_mean + by_ray * vec2(equal(ray, through));
    vec3 by_p = vec3(by_through / p.z, by_depth - dot(by_through, through) / p.z);

    Gradients g;
    g.centre = by_p.x * camera.row_x.xyz + by_p.y * camera.row_y.xyz + by_p.z * camera.row_z.xyz;
    g.opacity = by_plain * plain * (1.0 - plain);
    g.log_scale = vec3(dot(by_axes[0], axes[0]), dot(by_axes[1], axes[1]), dot(by_axes[2], axes[2]));
    mat3 by_turned = mat3(scale.x * by_axes[0], scale.y * by_axes[1], scale.z * by_axes[2]);
    // r[c][r] of by_turned is the gradient by row r, column c of the rotation matrix.
    float w = unit.x, a = unit.y, b = unit.z, c = unit.w;
    mat3 t = by_turned;
    vec4 by_unit = 2.0 * vec4(
        a * (t[1][2] - t[2][1]) + b * (t[2][0] - t[0][2]) + c * (t[0][1] - t[1][0]),
        w * (t[1][2] - t[2][1]) - 2.0 * a * (t[1][1] + t[2][2]) + b * (t[1][0] + t[0][1]) + c * (t[2][0] + t[0][2]),
        w * (t[2][0] - t[0][2]) - 2.0 * b * (t[0][0] + t[2][2]) + a * (t[1][0] + t[0][1]) + c * (t[2][1] + t[1][2]),
        w * (t[0][1] - t[1][0]) - 2.0 * c * (t[0][0] + t[1][1]) + a * (t[2][0] + t[0][2]) + b * (t[2][1] + t[1][2])
    );
    g.rotation = (by_unit - unit * dot(unit, by_unit)) / size;
    if (POSES) {
        g.turn = cross(vector(CENTRE, i) - camera.position, g.centre);
        [[unroll]] for (uint k = 0; k < 3; ++k) g.turn += cross(axes[k], by_axes[k]);
    }
    return g;
}

void main() {
    uint i = group_index() * 64 + gl_LocalInvocationIndex, count = population[0];
    if (control[0] != 0) return;
    bool alive = i < count, seen = alive && projected[alive ? i : 0].opacity > 0.0;
    uvec2 run = seen ? runs[i] : uvec2(0);
    float sum[SUMS];
    if (!SUMMED) {
        sum = gathered(run);
    } else if (run.y > 0) {
        [[unroll]] for (uint c = 0; c < SUMS; ++c) sum[c] = partials[SUMS * i + c];
    }
    if (!alive) return;

    View camera = views[view];
    Gradients g = Gradients(vec3(0.0), vec3(0.0), vec4(0.0), 0.0, vec3(0.0));
    vec3 by_colour = vec3(0.0), towards = vec3(0.0);
    seen = run.y > 0;
    if (seen) {
        Projected splat = projected[i];
        by_colour = vec3(sum[0], sum[1], sum[2]) * vec3(greaterThan(splat.colour, vec3(0.0)));
        vec2 moment = vec2(sum[4], sum[5]);
        vec2 by_mean = vec2(dot(splat.conic.xy, moment), dot(splat.conic.yz, moment));
        vec3 by_conic = -vec3(0.5 * sum[6], sum[7], 0.5 * sum[8]);
        g = through_projection(camera, i, by_mean, by_conic, sum[3] / splat.opacity);
        towards = vector(CENTRE, i) - camera.position;
        if (STATISTICS) {
            float size = length(0.5 * by_mean * vec2(camera.width, camera.height));
            statistics[i] += vec2(size, 1.0);
        }
    }

    // The colour, four functions at a time; its gradient by the direction goes to the centre. Where this view tells nothing of it, it
    // stays as it is, as do its moments: they are most of what there is to read and write.
    float far = max(length(towards), 1e-12);
    vec3 direction = towards / far, by_direction = vec3(0.0);
    float basis[16];
    harmonics(direction, basis);
    float values[TOGETHER], gradients[TOGETHER], rates[TOGETHER];
    uint terms = (degree + 1) * (degree + 1);
    [[unroll]] for (uint k = 0; k < 16; k += 4) {
        if (k >= terms || by_colour == vec3(0.0)) break;
        uint plane = HARMONICS + 3 * k, count = 3 * min(terms - k, 4);
        [[unroll]] for (uint j = 0; j < TOGETHER; ++j) {
            values[j] = j < count ? parameters[at(plane + j, i)] : 0.0;
            gradients[j] = basis[k + j / 3] * by_colour[j % 3];
            rates[j] = k + j / 3 == 0 ? colour_rate : harmonics_rate;
        }
        [[unroll]] for (uint j = 0; j < 4; ++j) {
            vec3 coefficient = vec3(values[3 * j], values[3 * j + 1], values[3 * j + 2]);
            if (seen) by_direction += harmonic_gradient(k + j, direction) * dot(coefficient, by_colour);
        }
        if (!FROZEN) adam(plane, count, i, gradients, rates, values);
    }
    if (seen) g.centre += (by_direction - direction * dot(direction, by_direction)) / far;
    if (POSES) {
        [[unroll]] for (uint c = 0; c < 3; ++c) {
            forces[at(c, i)] = g.turn[c];
            forces[at(3 + c, i)] = g.centre[c];
        }
    }
    if (FROZEN) return;

    [[unroll]] for (uint k = 0; k < HARMONICS; ++k) values[k] = parameters[at(k, i)];
    float opacity = sigmoid(values[OPACITY]);
    gradients[OPACITY] = g.opacity + opacity_weight / float(count) * opacity * (1.0 - opacity);
    rates[OPACITY] = opacity_rate;
    [[unroll]] for (uint c = 0; c < 3; ++c) {
        gradients[CENTRE + c] = g.centre[c];
        gradients[LOG_SCALE + c] = g.log_scale[c] + scale_weight / (3.0 * float(count)) * exp(values[LOG_SCALE + c]);
        rates[CENTRE + c] = centre_rate;
        rates[LOG_SCALE + c] = scale_rate;
    }
    [[unroll]] for (uint c = 0; c < 4; ++c) {
        gradients[ROTATION + c] = g.rotation[c];
        rates[ROTATION + c] = rotation_rate;
    }
    adam(0, HARMONICS, i, gradients, rates, values);
    if (noise == 0.0) return;
    vec3 centre = vec3(values[CENTRE], values[CENTRE + 1], values[CENTRE + 2]);
    vec3 scale = exp(vec3(values[LOG_SCALE], values[LOG_SCALE + 1], values[LOG_SCALE + 2]));
    vec4 q = vec4(values[ROTATION], values[ROTATION + 1], values[ROTATION + 2], values[ROTATION + 3]);
    opacity = sigmoid(values[OPACITY]);

    // Faint Gaussians wander within their own shape.
    vec3 normal = normal3(pcg4d(uvec4(seed, NOISE_STREAM + iteration, i)));
    mat3 turned = rotation_of(normalize(q));
    vec3 step = turned * (scale * scale * (transpose(turned) * normal));
    float faint = sigmoid(-100.0 * (opacity - 0.005));
    [[unroll]] for (uint c = 0; c < 3; ++c) parameters[at(CENTRE + c, i)] = centre[c] + noise * faint * step[c];
}
