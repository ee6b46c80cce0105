// The views that see the point of a look, nearest to the viewer's direction first. Needs `trace` and, defined by the includer,
//   float view_cost(uint view, Look look, float bound, out vec3 n, out float d)
// the angle by which a view is ordered, FARTHEST or more where it is none or it is certain to reach `bound`, with the unit
// direction to it and its distance.
// Twin: src/quality/nearest.rs.

// Threads of a look, a power of two: each walks over some of the views and casts some of the rays.
layout(constant_id = 8) const uint LANES = 1;

const uint LISTED = 8;       // views that are examined between two passes over all
const uint WALKS = 16;       // of a look; what 128 nearer views do not see counts as unseen

struct Near {
    float cost;  // FARTHEST: none
    uint view;
};

// The nearest so far in the order of cost and index.
struct List {
    float costs[LISTED];
    uint views[LISTED];
};

// Puts a view into its place: the larger ones shift, the last is dropped.
void put(inout List list, float cost, uint view) {
    for (uint k = 0; k < LISTED; ++k) {
        if (cost < list.costs[k] || (cost == list.costs[k] && view < list.views[k])) {
            float cost_ = list.costs[k];
            uint view_ = list.views[k];
            list.costs[k] = cost;
            list.views[k] = view;
            cost = cost_;
            view = view_;
        }
    }
}

// Lists the nearest past `last` of the views that are this thread's.
void list_views(Look look, uint lane, uint count, Near last, out List list) {
    for (uint k = 0; k < LISTED; ++k) {
        list.costs[k] = FARTHEST;
        list.views[k] = 0xffffffffu;
    }
    for (uint j = lane; j < count; j += LANES) {
        vec3 n;
        float d, cost = view_cost(j, look, list.costs[LISTED - 1], n, d);
        bool next = cost > last.cost || (cost == last.cost && j > last.view);
        if (next && cost < list.costs[LISTED - 1]) put(list, cost, j);
    }
}

// Lists of the threads of a look, half of which wait here for the other half.
const uint PARKED = LANES > 1 ? 64 * LISTED * (LANES / 2) : 1;
shared float parked_costs[PARKED];
shared uint parked_views[PARKED];

void park(List list, uint slot) {
    for (uint k = 0; k < LISTED; ++k) {
        parked_costs[(slot * LISTED + k) * 64 + gl_LocalInvocationIndex % 64] = list.costs[k];
        parked_views[(slot * LISTED + k) * 64 + gl_LocalInvocationIndex % 64] = list.views[k];
    }
}

// Makes one list of those of a look's threads, for all of them. All threads of the workgroup call it.
void join_lists(uint lane, inout List list) {
    for (uint width = LANES / 2; width > 0; width /= 2) {
        barrier();
        if (lane >= width && lane < 2 * width) park(list, lane - width);
        barrier();
        for (uint k = 0; lane < width && k < LISTED; ++k) {
            uint from = (lane * LISTED + k) * 64 + gl_LocalInvocationIndex % 64;
            if (parked_views[from] != 0xffffffffu) put(list, parked_costs[from], parked_views[from]);
        }
    }
    barrier();
    if (lane == 0) park(list, 0);
    barrier();
    for (uint k = 0; k < LISTED; ++k) {
        list.costs[k] = parked_costs[k * 64 + gl_LocalInvocationIndex % 64];
        list.views[k] = parked_views[k * 64 + gl_LocalInvocationIndex % 64];
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
    List list;
    for (uint walk = 0; walk < WALKS; ++walk) {
        if (wanted) list_views(look, lane, count, last, list);
        if (LANES > 1) {
            join_lists(lane, list);
            // Rays of a look at the same time: one after another they would wait for memory.
            barrier();
            if (lane == 0) hidden[place] = 0;
            unfinished = 0;
            barrier();
            for (uint k = lane; wanted && k < LISTED; k += LANES) {
                if (list.views[k] != 0xffffffffu && is_hidden(list.views[k], look)) atomicOr(hidden[place], 1u << k);
            }
            barrier();
        }
        for (uint k = 0; wanted && k < LISTED; ++k) {
            if (list.views[k] == 0xffffffffu) wanted = false;
            else if (!(LANES > 1 ? (hidden[place] & (1u << k)) != 0 : is_hidden(list.views[k], look))) {
                found[have] = Near(list.costs[k], list.views[k]);
                wanted = ++have < 3;
            }
        }
        last = Near(list.costs[LISTED - 1], list.views[LISTED - 1]);
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
