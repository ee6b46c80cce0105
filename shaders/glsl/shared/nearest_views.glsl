// The views that see the point of a look, nearest to the viewer's direction first. Needs `trace` and, of whoever includes it,
//   float view_cost(uint view, Look look, out vec3 n, out float d)
// the angle by which a view is ordered, FARTHEST or more where it is none, with the unit direction to it and its distance.
// Twin: src/quality/nearest.rs.

const float FARTHEST = 2.0;  // radians; views farther away count as none: src/quality/nearest.rs
const uint LISTED = 8;       // views that are looked at between two walks over all
const uint WALKS = 16;       // of a look; what 128 nearer views do not see counts as unseen

// Angle between unit vectors, exact for small angles.
float angle_between(vec3 a, vec3 b) {
    return 2.0 * asin(min(0.5 * length(a - b), 1.0));
}

struct Near {
    float cost;  // FARTHEST: none
    uint view;
};

// Fills `found` with the three nearest of `count` views that nothing hides; returns how many there are.
uint nearest_views(Look look, uint count, out Near found[3]) {
    uint have = 0;
    for (uint k = 0; k < 3; ++k) found[k] = Near(FARTHEST, 0xffffffffu);
    float last_cost = -1.0;
    uint last_view = 0;
    for (uint walk = 0; walk < WALKS; ++walk) {
        float costs[LISTED];
        uint listed[LISTED];
        for (uint k = 0; k < LISTED; ++k) {
            costs[k] = FARTHEST;
            listed[k] = 0xffffffffu;
        }
        for (uint j = 0; j < count; ++j) {
            vec3 n;
            float d, cost = view_cost(j, look, n, d);
            // Past what has been looked at, in the order of cost and index.
            bool next = cost > last_cost || (cost == last_cost && j > last_view);
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
        for (uint k = 0; k < LISTED; ++k) {
            if (listed[k] == 0xffffffffu) return have;
            vec3 n;
            float d;
            view_cost(listed[k], look, n, d);
            if (trace(look.position, n, 0.0, d, true) < MISS) continue;
            found[have] = Near(costs[k], listed[k]);
            ++have;
            if (have == 3) return have;
        }
        last_cost = costs[LISTED - 1];
        last_view = listed[LISTED - 1];
    }
    return have;
}
