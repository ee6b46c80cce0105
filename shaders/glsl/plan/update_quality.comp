#version 450
#extension GL_GOOGLE_include_directive : require
// The end of an iteration where the expected error of viewers is minimised: each look left three partials (viewed.comp),
// each of the splat that its slot names, and its viewer's tally the factor of all of them.
#include "plan/update.glsl"
#include "plan/links.glsl"

const uint AHEAD = 15;  // slots of a thread that are read at once

void gather(uint j, Splat splat, Settings s, Control c, uint thread, inout Gradient sum, inout float reg) {
    uint count = s.probes * 192;
    for (uint first = thread; first < count; first += AHEAD * THREADS) {
        // Loads that wait for memory together.
        uint owners[AHEAD];
        for (uint i = 0; i < AHEAD; ++i) owners[i] = first + i * THREADS < count ? slots[first + i * THREADS] : NONE;
        for (uint i = 0; i < AHEAD; ++i) {
            if (owners[i] != j) continue;
            uint r = first + i * THREADS;
            float factor = tallies[r / 192].factor;
            sum.centre += factor * partials[r].centre;
            sum.direction += factor * partials[r].direction;
        }
    }
    if (j >= s.kept) add_links(j, splat, s, thread, sum, reg);
}
