#version 450
#extension GL_GOOGLE_include_directive : require
// The splat pass without binning: a workgroup per block of texels of a point camera. It lists the camera splats that the
// probe can see, forms the picture texel by texel over that list, then goes back and sums, splat by splat, over the
// texels' residuals.
// No atomics on floats and a fixed order everywhere: the same bits on every run. Twin: src/planner/plan/paper/dense.rs.
//
// An invocation's loops come to about 8 iterations a visible splat, far from the 65,535 at which
// lavapipe ends them; the planner keeps larger problems away from this stage.
#include "shared/fold.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
layout(local_size_x_id = 6) in;
layout(constant_id = 6) const uint THREADS = 256;  // a power of two from 64 to 1024
layout(constant_id = 7) const uint EACH = 1;       // texels of a thread, up to 4

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 4, std430) readonly buffer Directions { vec4 directions[]; };
// Distance to the first surface, per probe and texel; negative where the ray misses the feasible region (rho = 0).
layout(binding = 5, std430) readonly buffer Depth { float depth[]; };
layout(binding = 6, std430) coherent buffer Visible { uint visible[]; };
layout(binding = 7, std430) writeonly buffer Slots { uint slots[]; };
layout(binding = 8, std430) buffer Partials { Gradient partials[]; };
layout(binding = 9, std430) writeonly buffer Tallies { Tally tallies[]; };
layout(binding = 10, std430) writeonly buffer Deficit { float deficit[]; };
layout(binding = 11, std430) readonly buffer PaperBlock { PaperSettings paper[]; };
layout(binding = 12, std430) readonly buffer ScaleBlock { Scale scale_state[]; };
// Host-visible: [2] most splats that a probe saw, past the capacity.
layout(binding = 13, std430) buffer Mailbox { uint mailbox[]; };

const uint BLOCK = THREADS * EACH;  // texels of a workgroup
const uint BATCH = 64;              // splats at a time
const uint WORDS = THREADS / 32;

shared uint words[WORDS];
shared uint listed[THREADS];          // the first of the list; the rest lies in `visible`
shared vec4 batch_ray[BATCH];           // n, d
shared float batch_open[BATCH];         // alpha m
shared float left[BLOCK];               // transmittance; negative where rho = 0
shared vec4 sums[THREADS];
shared vec2 more_sums[THREADS];

uint list_visible(uint probe, vec3 position, Settings s, PaperSettings p) {
    uint count = 0;
    uint thread = gl_LocalInvocationIndex;
    for (uint base = 0; base < s.splats; base += THREADS) {
        if (thread < WORDS) words[thread] = 0;
        barrier();
        uint j = base + thread;
        bool seen = false;
        if (j < control[0].live) {
            vec3 ray = splats[j].centre - position;
            float d = length(ray);
            vec3 n = ray / max(d, 1e-6);
            seen = gate(-n, splats[j], p.gate_softness).open >= GATE_CUTOFF;
        }
        if (seen) atomicOr(words[thread >> 5], 1u << (thread & 31u));
        barrier();
        uint rank = count, all = count;
        for (uint k = 0; k < min(WORDS, (s.splats - base + 31) / 32); ++k) {
            uint bits = bitCount(words[k]);
            if (k < (thread >> 5)) rank += bits;
            all += bits;
        }
        rank += bitCount(words[thread >> 5] & ((1u << (thread & 31u)) - 1u));
        // Every block of the probe makes the same list; the first one's slots represent all.
        bool kept = seen && rank < p.capacity;
        if (j < s.splats && gl_WorkGroupID.y == 0) slots[probe * s.splats + j] = kept ? rank : NONE;
        if (seen && rank < THREADS) listed[rank] = j;
        else if (kept) visible[(probe * p.blocks + gl_WorkGroupID.y) * p.capacity + rank] = j;
        count = all;
        barrier();
    }
    memoryBarrierBuffer();
    barrier();
    return count;
}

// Index of the camera at a place of the list, whose overflow starts at `row`.
uint at(uint rank, uint row) {
    return rank < THREADS ? listed[rank] : visible[row + rank];
}

vec4 total_of(vec4 value) {
    uint thread = gl_LocalInvocationIndex;
    barrier();
    sums[thread] = value;
    FOLD(thread, THREADS, sums[thread] += sums[thread + apart]);
    barrier();
    return sums[0];
}

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    if (control[0].halt != 0) return;
    uint probe = gl_WorkGroupID.x, thread = gl_LocalInvocationIndex;
    uint index = (control[0].iteration * p.probes + probe) % p.pool;
    vec3 position = probes[index].position;
    float score = p.weighted != 0 ? probes[index].score : 1.0;
    uint pool_row = index * TEXELS;
    uint found = list_visible(probe, position, s, p);
    uint count = min(found, p.capacity);
    uint block = gl_WorkGroupID.y * BLOCK, row = (probe * p.blocks + gl_WorkGroupID.y) * p.capacity;

    float scale = exp(scale_state[0].log_scale);
    float inverse = 1.0 / (scale * scale);
    float share = texel_weight(probes[index], p);
    float loss = 0.0, short_fall = 0.0, open_sky = 0.0, by_log_scale = 0.0;

    // Lanes that share a splat on the way back: as many as keep every thread busy.
    uint lanes = THREADS;
    while (lanes > 1 && THREADS / lanes < count) lanes >>= 1;
    uint at_once = THREADS / lanes;

    vec3 w[4];
    float far[4], value[4];
    for (uint k = 0; k < EACH; ++k) {
        uint texel = block + k * THREADS + thread;
        w[k] = directions[min(texel, TEXELS - 1)].xyz;
        far[k] = depth[pool_row + min(texel, TEXELS - 1)];
        value[k] = 1.0;
    }
    for (uint base = 0; base < count; base += BATCH) {
        barrier();
        if (thread < BATCH && base + thread < count) {
            uint j = at(base + thread, row);
            vec3 ray = splats[j].centre - position;
            float d = length(ray);
            vec3 n = ray / max(d, 1e-6);
            batch_ray[thread] = vec4(n, d);
            batch_open[thread] = p.alpha * gate(-n, splats[j], p.gate_softness).open;
        }
        barrier();
        uint here = min(BATCH, count - base);
        for (uint b = 0; b < here; ++b) {
            vec4 ray = batch_ray[b];
            for (uint k = 0; k < EACH; ++k) {
                float x = kernel_exponent(w[k], ray.xyz, ray.w, inverse);
                if (x < KERNEL_CUTOFF && (!OCCLUSION || ray.w < abs(far[k]))) {
                    value[k] *= 1.0 - batch_open[b] * exp(-x);
                }
            }
        }
    }
    bool keep_deficit = p.relocate_every != 0 && (control[0].iteration + 1) % p.relocate_every == 0;
    for (uint k = 0; k < EACH; ++k) {
        uint texel = block + k * THREADS + thread;
        if (texel >= TEXELS) break;
        bool counts = far[k] > 0.0;
        float difference = (1.0 - value[k]) - p.alpha * score;
        float lack = max(-difference, 0.0);
        if (counts) {
            loss += difference * difference;
            open_sky += 1.0;
            short_fall += lack * lack;
        }
        if (keep_deficit) deficit[probe * TEXELS + texel] = counts ? lack * lack : 0.0;
        left[k * THREADS + thread] = counts ? value[k] : -1.0;
    }
    barrier();

    for (uint base = 0; base < count; base += at_once) {
        uint rank = base + thread / lanes, lane = thread % lanes;
        vec3 n = vec3(0.0), moment = vec3(0.0);
        float d = 1.0, total = 0.0, by_scale = 0.0, utility = 0.0;
        Gate g = Gate(0.0, vec3(0.0), vec3(0.0));
        if (rank < count) {
            CameraState splat = splats[at(rank, row)];
            vec3 ray = splat.centre - position;
            d = max(length(ray), 1e-6);
            n = ray / d;
            g = gate(-n, splat, p.gate_softness);
            float open = p.alpha * g.open;
            uint texels = min(BLOCK, TEXELS - block);
            for (uint first = lane; first < texels; first += 4 * lanes) {
                for (uint i = 0; i < 4; ++i) {
                    uint t = first + i * lanes;
                    float rest = t < texels ? left[t] : -1.0;
                    if (rest < 0.0) continue;
                    vec3 w = directions[block + t].xyz;
                    float x = kernel_exponent(w, n, d, inverse);
                    if (x < KERNEL_CUTOFF && (!OCCLUSION || d < abs(depth[pool_row + block + t]))) {
                        float a = open * exp(-x);
                        float odds = a / (1.0 - a);
                        float difference = 1.0 - rest - p.alpha * score;
                        float by_a = 2.0 * share * difference * rest * odds;  // (dL/da) a
                        total += by_a;
                        moment += KERNEL == ANGULAR ? by_a * w : (by_a * d * dot(w, n)) * w;
                        by_scale += 2.0 * x * by_a;
                        // (I_without - goal)^2 - (I - goal)^2
                        utility -= share * rest * odds * (2.0 * difference - rest * odds);
                    }
                }
            }
        }
        sums[thread] = vec4(moment, total);
        more_sums[thread] = vec2(by_scale, utility);
        FOLD(lane, lanes, sums[thread] += sums[thread + apart]; more_sums[thread] += more_sums[thread + apart]);
        barrier();
        if (lane == 0 && rank < count) {
            Gradient grad = splat_gradient(n, d, g, sums[thread].xyz, sums[thread].w, inverse);
            grad.own = more_sums[thread].x;
            grad.utility = more_sums[thread].y;
            by_log_scale += grad.own;
            partials[row + rank] = grad;
        }
        barrier();
    }

    vec4 total = total_of(vec4(loss, short_fall, open_sky, by_log_scale));
    if (thread != 0) return;
    tallies[probe * p.blocks + gl_WorkGroupID.y] = Tally(total.x * share, total.w, total.y, total.z, found);
    // Host memory is slow: it is touched where there are too many alone.
    if (found > p.capacity) atomicMax(mailbox[2], found);
}
