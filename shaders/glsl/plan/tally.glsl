// The end of an iteration, by the last workgroup of the update to get there: sums the losses, steps the shared scale,
// writes the history and sets up the next iteration. Twin: src/plan/tally.rs (all but the sums).
//
// A stage of its own would wait for all of the update and make the next iteration wait in turn; on a GPU those two waits
// are longer than the work. Which workgroup comes last is chance, but what it sums and in which order is not.

struct Record {
    float image;
    float reg;
    float bound;
    float log_scale;
};

layout(binding = 11, std430) writeonly buffer History { Record history[]; };
// Host-visible: [0] the host requests a stop; [1] iterations done; [2] most splats that a probe saw.
layout(binding = 12, std430) buffer Mailbox { uint mailbox[]; };
// [0] workgroups that are done with this iteration; [1] the host requests a stop. Separate from `control`, which every thread
// reads: coherent loads of one word by all of them would queue up.
layout(binding = 13, std430) buffer Arrivals { uint arrivals[]; };

shared uint most[THREADS];
shared bool last;

// Whether this workgroup is the last of `s.splats` to have written its terms: only then may it read those of the others.
bool is_last(Settings s, uint thread) {
    memoryBarrierBuffer();
    if (thread == 0) last = atomicAdd(arrivals[0], 1) + 1 == s.splats;
    barrier();
    memoryBarrierBuffer();
    return last;
}

void tally(Settings s, Control c, uint thread) {
    vec4 sum = vec4(0.0);
    uint seen = 0;
    for (uint i = thread; i < s.probes * s.blocks; i += THREADS) {
        sum.x += tallies[i].image;
        sum.w += tallies[i].log_scale;
        seen = max(seen, tallies[i].visible);
    }
    for (uint j = thread; j < c.live; j += THREADS) sum.yz += vec2(got(terms[2 * j]), got(terms[2 * j + 1]));
    sums[thread] = sum;
    most[thread] = seen;
    FOLD(thread, THREADS, sums[thread] += sums[thread + apart]; most[thread] = max(most[thread], most[thread + apart]));
    if (thread != 0) return;
    history[c.iteration] = Record(sums[0].x, sums[0].y, sums[0].z, c.log_scale);

    if (s.lr_scale > 0.0) {
        float gradient = sums[0].w + 2.0 * s.lambda_scale * exp(2.0 * c.log_scale);
        adam_means(gradient, c.scale_mean, c.scale_square);
        vec2 corrections = adam_corrections(c.step);
        float m = c.scale_mean / corrections.x, v = c.scale_square / corrections.y;
        c.log_scale = max(c.log_scale - s.lr_scale * c.rate * m / (sqrt(v) + 1e-10), log(s.scale_floor));
    }
    c.iteration += 1;
    c.step += 1;
    uint length_ = s.round_length != 0 ? s.round_length : s.iterations;
    if (s.round_length != 0 && c.iteration % s.round_length == 0) {
        c.first += 1;
        c.live = min(c.live + 1, s.splats);
        c.step = 1;
    }
    c.rate = pow(s.decay, float(c.step - 1) / float(length_));
    if (c.iteration >= s.iterations || arrivals[1] != 0) c.halt = 1;
    c.most_visible = max(c.most_visible, most[0]);
    control[0] = c;
    arrivals[0] = 0;
    mailbox[1] = c.iteration;
    mailbox[2] = c.most_visible;
}
