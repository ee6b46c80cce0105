// The views that see the point of a look, nearest to the viewer's direction first. Needs `trace` and, of whoever includes it,
//   float view_cost(uint view, Look look, float bound, out vec3 n, out float d)
// the angle by which a view is ordered, FARTHEST or more where it is none or it is certain to reach `bound`, with the unit
// direction to it and its distance.
// Twin: src/quality/nearest.rs.

layout(constant_id = 10) const uint LANES = 1;  // threads of a look, each of which casts some of its rays

const uint LISTED = 8;       // views that are looked at between two walks over all
const uint WALKS = 16;       // of a look; what 128 nearer views do not see counts as unseen

struct Near {
    float cost;  // FARTHEST: none
    uint view;
};

// Lists the nearest views past `last` in the order of cost and index.
void list_views(Look look, uint count, Near last, out float costs[LISTED], out uint listed[LISTED]) {
    for (uint k = 0; k < LISTED; ++k) {
        costs[k] = FARTHEST;
        listed[k] = 0xffffffffu;
    }
    for (uint j = 0; j < count; ++j) {
        vec3 n;
        float d, cost = view_cost(j, look, costs[LISTED - 1], n, d);
        bool next = cost > last.cost || (cost == last.cost && j > last.view);
        if (!next || !(cost < costs[LISTED - 1])) continue;
        // Into its place: the larger ones move on.
        uint view = j;
        for (uint k = 0; k < LISTED; ++k) {
            if (cost < costs[k]) {
                float cost_ = costs[k];
                uint view_ = listed[k];
                costs[k] = cost;
                listed[k] = view;
                cost = cost_;
                view = view_;
            }
        }
    }
}

bool is_hidden(uint view, Look look) {
    vec3 n;
    float d;
    view_cost(view, look, FARTHEST, n, d);
    return trace(look.position, n, 0.0, d, true) < MISS;
}

shared uint hidden[64];
shared uint unfinished;

// Fills `found` with the three nearest of `count` views that nothing hides; returns how many there are. All threads of the
// workgroup call it, those of a look (64 apart) with the same look; one that is not `wanted` finds nothing.
uint nearest_views(Look look, bool wanted, uint count, out Near found[3]) {
    uint have = 0, place = gl_LocalInvocationIndex % 64, lane = gl_LocalInvocationIndex / 64;
    for (uint k = 0; k < 3; ++k) found[k] = Near(FARTHEST, 0xffffffffu);
    Near last = Near(-1.0, 0);
    float costs[LISTED];
    uint listed[LISTED];
    for (uint walk = 0; walk < WALKS; ++walk) {
        if (wanted) list_views(look, count, last, costs, listed);
        if (LANES > 1) {
            // Rays of a look at the same time: one after another they would wait for memory.
            barrier();
            if (lane == 0) hidden[place] = 0;
            unfinished = 0;
            barrier();
            for (uint k = lane; wanted && k < LISTED; k += LANES) {
                if (listed[k] != 0xffffffffu && is_hidden(listed[k], look)) atomicOr(hidden[place], 1u << k);
            }
            barrier();
        }
        for (uint k = 0; wanted && k < LISTED; ++k) {
            if (listed[k] == 0xffffffffu) wanted = false;
            else if (!(LANES > 1 ? (hidden[place] & (1u << k)) != 0 : is_hidden(listed[k], look))) {
                found[have] = Near(costs[k], listed[k]);
                wanted = ++have < 3;
            }
        }
        last = Near(costs[LISTED - 1], listed[LISTED - 1]);
        if (LANES > 1) {
            if (wanted) unfinished = 1;
            barrier();
            if (unfinished == 0) break;
        } else if (!wanted) {
            break;
        }
    }
    return have;
}
