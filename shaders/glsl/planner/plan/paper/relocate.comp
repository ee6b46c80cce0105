#version 450
#extension GL_GOOGLE_include_directive : require
// Relocation: a workgroup for each of the tenth of splats with the least utility. One under a fifth of the median is put
// where light is missing: a probe and a direction are drawn with probability proportional to the squared deficit, the camera is
// placed at a uniform distance on the feasible, unblocked part of that ray and looks back.
#include "planner/plan/plan.glsl"
#include "planner/plan/paper/paper.glsl"
#include "shared/random.glsl"
layout(local_size_x = 256) in;

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) readonly buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Probes { Probe probes[]; };
layout(binding = 4, std430) readonly buffer Directions { vec4 directions[]; };
layout(binding = 5, std430) readonly buffer Depth { float depth[]; };
layout(binding = 6, std430) readonly buffer Deficit { float deficit[]; };
layout(binding = 11, std430) readonly buffer Tallies { Tally tallies[]; };
layout(binding = 7, std430) buffer MomentsBlock { Moments moments[]; };
layout(binding = 8, std430) readonly buffer Order { uint order[]; };
#include "shared/region_types.glsl"
layout(binding = 9, std430) readonly buffer RegionBlock { DeviceRegion region[]; };
layout(binding = 10, std430) readonly buffer FreeDistance { float free_distance[]; };
layout(binding = 12, std430) readonly buffer PaperBlock { PaperSettings paper[]; };
#include "shared/region.glsl"

shared float strip_sums[256];

// How much a probe lacks, in the weight that the loss gives it.
float missing(uint probe, PaperSettings p) {
    uint index = ((control[0].iteration - 1) * p.probes + probe) % p.pool;
    float sum = 0.0;
    for (uint b = probe * p.blocks; b < (probe + 1) * p.blocks; ++b) sum += tallies[b].short_fall;
    return sum * texel_weight(probes[index], p);
}

// Distance from `from` along unit `w` at which a camera may be placed, uniform over the feasible part of the ray before `reach` as
// 32 steps find it; negative where they find none. `pick` and `jitter` are uniform in [0, 1).
float stand_along(vec3 from, vec3 w, float reach, float pick, float jitter) {
    // The region lies within the unit ball.
    float middle = dot(from, w), outer = middle * middle - dot(from, from) + 1.0;
    if (outer < 0.0) return -1.0;
    float near = max(-middle - sqrt(outer), 0.0), far = min(-middle + sqrt(outer), reach);
    if (near >= far) return -1.0;
    uint feasible = 0;
    for (uint k = 0; k < 32; ++k) {
        if (region_contains(from + w * mix(near, far, (float(k) + jitter) / 32.0))) feasible |= 1u << k;
    }
    uint count = bitCount(feasible);
    if (count == 0) return -1.0;
    for (uint k = min(uint(pick * float(count)), count - 1); k > 0; --k) feasible &= feasible - 1u;
    return mix(near, far, (float(findLSB(feasible)) + jitter) / 32.0);
}

// What is drawn from: probes by what they lack (`probe` is NONE), or the texels of a probe by their deficit.
float mass(uint probe, uint k, PaperSettings p) {
    return probe == NONE ? missing(k, p) : deficit[probe * TEXELS + k];
}

// Index in [0, count) drawn with probability proportional to its mass; each thread sums a strip, the strips are walked in
// order. Returns `count` where all of it is zero.
uint draw(uint probe, uint count, float uniform_, PaperSettings p) {
    uint thread = gl_LocalInvocationIndex;
    uint strip = (count + 255) / 256;
    uint first = min(thread * strip, count), last = min(first + strip, count);
    float mine = 0.0;
    for (uint k = first; k < last; ++k) mine += mass(probe, k, p);
    barrier();
    strip_sums[thread] = mine;
    barrier();
    float all = 0.0;
    for (uint t = 0; t < 256; ++t) all += strip_sums[t];
    if (!(all > 0.0)) return count;
    float aim = uniform_ * all;
    uint t = 0;
    while (t < 255 && aim >= strip_sums[t]) aim -= strip_sums[t++];
    uint k = min(t * strip, count - 1), end = min(k + strip, count);
    while (k + 1 < end && aim >= mass(probe, k, p)) aim -= mass(probe, k++, p);
    return k;
}

void main() {
    Settings s = settings[0];
    PaperSettings p = paper[0];
    uint thread = gl_LocalInvocationIndex;
    uint iteration = control[0].iteration;
    if (!relocation_due(control[0], p)) return;
    uint planned = s.splats - s.kept;
    uint j = order[gl_WorkGroupID.x];
    float median = moments[order[planned / 2]].utility;
    if (!(moments[j].utility < 0.2 * max(median, 0.0))) return;

    // A probe of the last batch, then one of its texels.
    vec4 random = random4(p.seed, 0x72656c6fu, iteration, j);
    uint probe = draw(NONE, p.probes, random.x, p);
    if (probe >= p.probes) return;
    uint texel = draw(probe, TEXELS, random.w, p);
    if (texel >= TEXELS || thread != 0) return;
    uint index = ((iteration - 1) * p.probes + probe) % p.pool;
    vec3 from = probes[index].position, w = directions[texel].xyz;
    float distance_ = stand_along(from, w, abs(depth[index * TEXELS + texel]), random.y, random.z);
    if (distance_ < 0.0) return;
    splats[j].centre = from + distance_ * w;
    splats[j].direction = -w;
    moments[j] = Moments(vec3(0.0), 0, vec3(0.0), 0, vec3(0.0), 0, vec3(0.0), median);
}
