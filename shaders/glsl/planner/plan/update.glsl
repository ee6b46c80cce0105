// The end of an iteration, a workgroup per camera splat: sums its partials in fixed order (`gather`, of the objective's
// own stage), adds the region's pull, and takes one Adam step (Kingma and Ba 2015). The last workgroup ends the iteration
// (planner/plan/finish.glsl). The objective's stage includes this and defines four functions: `begin`, `gather`, `own_sums` and
// `own_step`.
// Twins: src/planner/plan/update.rs (the step) and src/visibility/device_scene.rs (the region).
#include "shared/adam.glsl"
#include "shared/fold.glsl"
#include "shared/across.glsl"
#include "planner/plan/plan.glsl"
layout(local_size_x_id = 6) in;
layout(constant_id = 6) const uint THREADS = 256;  // a power of two from 64 to 1024

layout(binding = 0, std430) readonly buffer SettingsBlock { Settings settings[]; };
layout(binding = 1, std430) buffer ControlBlock { Control control[]; };
layout(binding = 2, std430) buffer Splats { CameraState splats[]; };
layout(binding = 3, std430) readonly buffer Slots { uint slots[]; };
layout(binding = 4, std430) readonly buffer Partials { Gradient partials[]; };
layout(binding = 5, std430) buffer MomentsBlock { Moments moments[]; };
// What each splat adds to the loss, unweighted: its penalty and its squared distance outside the region, as bits, since
// only atomics reach the other workgroups of a dispatch on every device (Metal has no coherent buffers).
layout(binding = 6, std430) buffer TermsBlock { uint terms[]; };
layout(binding = 7, std430) writeonly buffer Gradients { Gradient gradients[]; };
#include "shared/region_types.glsl"
layout(binding = 8, std430) readonly buffer RegionBlock { DeviceRegion region[]; };
layout(binding = 9, std430) readonly buffer FreeDistance { float free_distance[]; };
#include "shared/region.glsl"

shared vec4 sums[THREADS];
shared vec4 more_sums[THREADS];

#include "planner/plan/finish.glsl"

vec3 adam(vec3 gradient, inout vec3 mean, inout vec3 square, uint steps) {
    adam_means(gradient, mean, square);
    vec2 corrections = adam_corrections(steps);
    return (mean / corrections.x) / (sqrt(square / corrections.y) + 1e-10);
}

// Of the objective. Reads what it has beside the settings: first of all, so that it waits for memory together with these.
void begin();

// Of the objective. Adds to `sum` what this thread has to add of splat j, and to `penalty` its part of what each
// camera is penalised for, or of a loss that each has.
void gather(uint j, CameraState splat, Settings s, Control c, uint thread, inout Gradient sum, inout float penalty);

// Sums the partials of splat j, by all threads; the first one moves it.
void update(uint j, Settings s, Control c, uint thread) {
    CameraState splat = splats[j];
    // Loaded before the sums, needed after them.
    Moments m = moments[j];
    vec3 outward = vec3(0.0);
    float bound = 0.0;
    bool moves = j >= c.first && j < c.live;
    if (moves && thread == 0) bound = region_violation(splat.centre, outward);
    Gradient sum = Gradient(vec3(0.0), 0.0, vec3(0.0), 0.0);
    float penalty = 0.0;
    gather(j, splat, s, c, thread, sum, penalty);
    sums[thread] = vec4(sum.centre, penalty);
    more_sums[thread] = vec4(sum.direction, sum.utility);
    FOLD(thread, THREADS, sums[thread] += sums[thread + apart]; more_sums[thread] += more_sums[thread + apart]);
    if (thread != 0) return;

    vec3 by_centre = sums[0].xyz + s.lambda_bound * outward, by_direction = more_sums[0].xyz;
    put(terms[2 * j], sums[0].w);
    put(terms[2 * j + 1], bound);
    gradients[j] = Gradient(by_centre, 0.0, by_direction, more_sums[0].w);
    if (!moves) return;

    splat.centre -= s.lr_position * c.rate * adam(by_centre, m.centre_mean, m.centre_square, c.step);
    // Only the part across the direction turns it; the part along it would only feed the moments.
    by_direction -= dot(by_direction, splat.direction) * splat.direction;
    vec3 change = adam(by_direction, m.direction_mean, m.direction_square, c.step);
    splat.direction = normalize(splat.direction - s.lr_direction * c.rate * change);
    m.utility = mix(more_sums[0].w, m.utility, 0.9);
    splats[j] = splat;
    moments[j] = m;
}

void main() {
    begin();
    Settings s = settings[0];
    Control c = control[0];
    uint j = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x, thread = gl_LocalInvocationIndex;
    if (c.halt != 0 || j >= s.splats) return;
    // Host memory is slow to read: one workgroup reads for all, hidden behind its sums.
    uint stop = j == 0 && thread == 0 ? mailbox[0] : 0;
    update(j, s, c, thread);
    if (stop != 0) arrivals[1] = stop;
    if (is_last(s, thread)) finish(s, c, thread);
}
