#version 450
#extension GL_GOOGLE_include_directive : require
// Binned pass, 6 of 8: a workgroup per tile of a probe sums, instance by instance, over the residuals of its texels. Each
// instance has its own place to write to, so no order of execution can show.
#include "shared/fold.glsl"
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
#include "planner/plan/paper/bin.glsl"
layout(local_size_x = 64) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) readonly buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 4, std430) readonly buffer Directions { vec4 directions[]; };
layout(binding = 5, std430) readonly buffer Depth { float depth[]; };
layout(binding = 6, std430) readonly buffer Pairs { uint pairs[]; };
layout(binding = 7, std430) readonly buffer InstanceSlots { uint instance_slots[]; };
layout(binding = 8, std430) readonly buffer TileInstances { uint tile_instances[]; };
layout(binding = 9, std430) readonly buffer Ranges { uvec2 ranges[]; };
layout(binding = 10, std430) readonly buffer Left { float left[]; };
layout(binding = 11, std430) writeonly buffer InstanceSums { InstanceSum instance_sums[]; };
layout(binding = 12, std430) readonly buffer PaperBlock { PaperSettings paper[]; };
layout(binding = 13, std430) readonly buffer ScaleBlock { Scale scale_state[]; };

shared vec4 texels[64];  // direction, transmittance
shared float far[64];
shared vec4 sums[64];
shared vec2 more_sums[64];

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    if (control[0].halt != 0) return;
    uint tile = gl_WorkGroupID.x, probe = gl_WorkGroupID.y, thread = gl_LocalInvocationIndex;
    uvec2 range = ranges[probe * TILES + tile];
    uint count = range.y - range.x;
    if (count == 0) return;
    uint index = (control[0].iteration * p.probes + probe) % p.pool;
    vec3 position = probes[index].position;
    float goal = p.alpha * (p.weighted != 0 ? probes[index].score : 1.0);
    float share = texel_weight(probes[index], p);
    float scale = exp(scale_state[0].log_scale), inverse = 1.0 / (scale * scale);
    uint mine = tile_texel(tile, thread);
    texels[thread] = vec4(directions[mine].xyz, left[probe * TEXELS + mine]);
    far[thread] = abs(depth[index * TEXELS + mine]);
    barrier();

    uint lanes = 64;
    while (lanes > 1 && 64 / lanes < count) lanes >>= 1;
    uint at_once = 64 / lanes;
    for (uint base = 0; base < count; base += at_once) {
        uint rank = base + thread / lanes, lane = thread % lanes, instance = 0;
        vec3 moment = vec3(0.0);
        float total = 0.0, by_scale = 0.0, utility = 0.0;
        if (rank < count) {
            instance = tile_instances[range.x + rank];
            CameraState splat = splats[pairs[instance_slots[instance]] % s.splats];
            vec3 ray = splat.centre - position;
            float d = max(length(ray), 1e-6);
            vec3 n = ray / d;
            float open = p.alpha * gate(-n, splat, p.gate_softness).open;
            for (uint t = lane; t < 64; t += 4 * lanes) {
                for (uint i = 0; i < 4; ++i) {
                    uint u = t + i * lanes;
                    float rest = u < 64 ? texels[u].w : -1.0;
                    if (rest < 0.0) continue;
                    vec3 w = texels[u].xyz;
                    float x = kernel_exponent(w, n, d, inverse);
                    if (x >= KERNEL_CUTOFF || (OCCLUSION && d >= far[u])) continue;
                    float a = open * exp(-x), odds = a / (1.0 - a);
                    float difference = 1.0 - rest - goal;
                    float by_a = 2.0 * share * difference * rest * odds;  // (dL/da) a
                    total += by_a;
                    moment += KERNEL == ANGULAR ? by_a * w : (by_a * d * dot(w, n)) * w;
                    by_scale += 2.0 * x * by_a;
                    utility -= share * rest * odds * (2.0 * difference - rest * odds);
                }
            }
        }
        barrier();
        sums[thread] = vec4(moment, total);
        more_sums[thread] = vec2(by_scale, utility);
        FOLD(lane, lanes, sums[thread] += sums[thread + apart]; more_sums[thread] += more_sums[thread + apart]);
        if (lane == 0 && rank < count) {
            instance_sums[instance] = InstanceSum(sums[thread].xyz, sums[thread].w, more_sums[thread].x, more_sums[thread].y, 0, 0);
        }
    }
}
