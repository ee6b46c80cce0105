// The end of an iteration, by the last workgroup of the update to get there: sums the losses, writes the history and sets up the next
// iteration. Twin: src/planner/plan/clock.rs (all but the sums).
//
// A stage of its own would wait for all of the update and make the next iteration wait in turn; on a GPU those two waits
// are longer than the work. Which workgroup comes last is chance, but what it sums and in which order is not.

struct Record {
    float loss;     // the objective's own
    float penalty;
    float bound;
    float state;    // of the objective, before its step
};

layout(binding = 10, std430) writeonly buffer History { Record history[]; };
// Host-visible: [0] the host requests a stop; [1] iterations done; the others are the objective's.
layout(binding = 11, std430) buffer Mailbox { uint mailbox[]; };
// [0] workgroups that are done with this iteration; [1] the host requests a stop. Separate from `control`, which every thread
// reads: coherent loads of one word by all of them would queue up.
layout(binding = 12, std430) buffer Arrivals { uint arrivals[]; };

shared bool last;

// Whether this workgroup is the last of `s.splats` to have written its terms: only then may it read those of the others.
bool is_last(Settings s, uint thread) {
    memoryBarrierBuffer();
    if (thread == 0) last = atomicAdd(arrivals[0], 1) + 1 == s.splats;
    barrier();
    memoryBarrierBuffer();
    return last;
}

// Of the objective. What this thread has to add to its loss, and to a second sum of its own.
vec2 own_sums(uint thread);

// Of the objective. A step of what it learns beside the poses, by its second sum; answers what the history notes of that.
float own_step(Control c, float own);

void finish(Settings s, Control c, uint thread) {
    vec2 own = own_sums(thread);
    vec4 sum = vec4(own.x, 0.0, 0.0, own.y);
    for (uint j = thread; j < c.live; j += THREADS) sum.yz += vec2(got(terms[2 * j]), got(terms[2 * j + 1]));
    sums[thread] = sum;
    FOLD(thread, THREADS, sums[thread] += sums[thread + apart]);
    if (thread != 0) return;
    history[c.iteration] = Record(sums[0].x, sums[0].y, sums[0].z, own_step(c, sums[0].w));

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
    control[0] = c;
    arrivals[0] = 0;
    mailbox[1] = c.iteration;
}
