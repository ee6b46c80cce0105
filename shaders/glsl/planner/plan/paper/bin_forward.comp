#version 450
#extension GL_GOOGLE_include_directive : require
// Binned pass, 5 of 8: a workgroup per tile of a probe composites its instances front to back, a texel to a thread.
// The loop over instances takes four at a time: lavapipe ends an invocation's loops after 65,535 iterations.
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
// Transmittance of each texel; negative where rho = 0.
layout(binding = 10, std430) writeonly buffer Left { float left[]; };
// Loss, squared deficit, reachable texels of each tile; the gradient by log s comes later.
layout(binding = 11, std430) writeonly buffer TileSums { vec4 tile_sums[]; };
layout(binding = 12, std430) writeonly buffer Deficit { float deficit[]; };
layout(binding = 13, std430) readonly buffer PaperBlock { PaperSettings paper[]; };
layout(binding = 14, std430) readonly buffer ScaleBlock { Scale scale_state[]; };

shared vec4 batch_ray[64];
shared float batch_open[64];
shared vec4 sums[64];

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    if (control[0].halt != 0) return;
    uint tile = gl_WorkGroupID.x, probe = gl_WorkGroupID.y, thread = gl_LocalInvocationIndex;
    uint index = (control[0].iteration * p.probes + probe) % p.pool;
    vec3 position = probes[index].position;
    uint texel = tile_texel(tile, thread);
    vec3 w = directions[texel].xyz;
    float far = depth[index * TEXELS + texel], rest = 1.0;
    float scale = exp(scale_state[0].log_scale), inverse = 1.0 / (scale * scale);
    uvec2 range = ranges[probe * TILES + tile];
    for (uint base = range.x; base < range.y; base += 64) {
        barrier();
        batch_open[thread] = 0.0;
        if (base + thread < range.y) {
            CameraState splat = splats[pairs[instance_slots[tile_instances[base + thread]]] % s.splats];
            vec3 ray = splat.centre - position;
            float d = max(length(ray), 1e-6);
            batch_ray[thread] = vec4(ray / d, d);
            batch_open[thread] = p.alpha * gate(-ray / d, splat, p.gate_softness).open;
        }
        barrier();
        for (uint b = 0; b < min(64, range.y - base); b += 4) {
            for (uint i = 0; i < 4; ++i) {
                uint k = b + i;
                vec4 ray = batch_ray[k];
                float x = kernel_exponent(w, ray.xyz, ray.w, inverse);
                if (batch_open[k] > 0.0 && x < KERNEL_CUTOFF && (!OCCLUSION || ray.w < abs(far))) {
                    rest *= 1.0 - batch_open[k] * exp(-x);
                }
            }
        }
    }
    bool counts = far > 0.0;
    float score = p.weighted != 0 ? probes[index].score : 1.0;
    float difference = 1.0 - rest - p.alpha * score;
    float lack = max(-difference, 0.0);
    left[probe * TEXELS + texel] = counts ? rest : -1.0;
    if (p.relocate_every != 0 && (control[0].iteration + 1) % p.relocate_every == 0) {
        deficit[probe * TEXELS + texel] = counts ? lack * lack : 0.0;
    }
    sums[thread] = counts ? vec4(difference * difference, lack * lack, 1.0, 0.0) : vec4(0.0);
    FOLD(thread, 64, sums[thread] += sums[thread + apart]);
    if (thread == 0) tile_sums[probe * TILES + tile] = sums[0];
}
