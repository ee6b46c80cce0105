#version 450
#extension GL_GOOGLE_include_directive : require
// The end of an iteration where the expected error of viewers is minimised: each look left three partials (viewed.comp),
// each of the splat that its slot names.
#include "plan/update.glsl"
#include "plan/links.glsl"

void gather(uint j, Splat splat, Settings s, Control c, uint thread, inout Gradient sum, inout float reg) {
    for (uint r = thread; r < s.probes * 192; r += GROUP) {
        if (slots[r] != j) continue;
        sum.centre += partials[r].centre;
        sum.direction += partials[r].direction;
        sum.utility += partials[r].utility;
    }
    if (j >= s.kept) add_links(j, splat, s, thread, sum, reg);
}
