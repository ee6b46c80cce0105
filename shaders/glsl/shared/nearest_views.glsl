// The views that see the point of a look, nearest to the viewer's direction first. Needs `trace` and, defined by the includer,
//   float view_cost(uint view, Look look, float bound, out vec3 n, out float d)
// the angle by which a view is ordered, FARTHEST or more where it is none or it is certain to reach `bound`, with the unit
// direction to it and its distance.
// Twin: src/planner/quality/nearest.rs.

const uint LISTED = 8;   // views that are examined between two passes over all
const uint WALKS = 16;   // of a look; what 128 nearer views do not see counts as unseen

struct Near {
    float cost;  // FARTHEST: none
    uint view;
};

const Near NOWHERE = Near(FARTHEST, 0xffffffffu);
const Near FIRST = Near(-1.0, 0);  // before all views

// The order of views.
bool is_before(Near a, Near b) {
    return a.cost < b.cost || (a.cost == b.cost && a.view < b.view);
}

// Whether something stands between the point and a view.
bool is_hidden(uint view, Look look) {
    vec3 n;
    float d;
    view_cost(view, look, FARTHEST, n, d);
    return trace(look.position, n, 0.0, d, true) < MISS;
}

// Lists the nearest past `last` in their order.
void list_views(Look look, uint count, Near last, out Near list[LISTED]) {
    for (uint k = 0; k < LISTED; ++k) list[k] = NOWHERE;
    for (uint j = 0; j < count; ++j) {
        vec3 n;
        float d, bound = list[LISTED - 1].cost;
        Near next = Near(view_cost(j, look, bound, n, d), j);
        if (next.cost >= bound || !is_before(last, next)) continue;
        // Into its place: those after it shift, the last is dropped.
        for (uint k = 0; k < LISTED; ++k) {
            Near other = list[k];
            bool shifts = is_before(next, other);
            list[k] = shifts ? next : other;
            next = shifts ? other : next;
        }
    }
}

// Fills `found` with the three nearest of `count` views that nothing hides; returns how many there are.
uint nearest_views(Look look, uint count, out Near found[3]) {
    uint have = 0;
    for (uint k = 0; k < 3; ++k) found[k] = NOWHERE;
    Near last = FIRST;
    for (uint walk = 0; walk < WALKS && have < 3 && last.cost < FARTHEST; ++walk) {
        Near list[LISTED];
        list_views(look, count, last, list);
        for (uint k = 0; k < LISTED && have < 3 && list[k].cost < FARTHEST; ++k) {
            if (!is_hidden(list[k].view, look)) found[have++] = list[k];
        }
        last = list[LISTED - 1];
    }
    return have;
}
