// As `nearest_views` of shared/nearest_views.glsl, with the same result, by 32 threads of a look, which are a workgroup. Each of them
// examines every 32nd splat and casts one ray at a time: for devices that have more threads than there are looks.

const uint TOGETHER = 32;
const uint EXAMINED = 4;  // splats of a thread between two barriers, loaded at the same time
const uint RAYS = 8;      // that are cast at first: most looks need no more

// The nearest so far in their order, then those that wait to be put among them: fewer than TOGETHER before some are examined.
const uint PARTS = 2 + EXAMINED;
shared Near nearest[PARTS * TOGETHER];
shared uint waiting;
shared bool hidden[TOGETHER];

// Puts those that wait among the nearest: each goes where the number of those before it says.
void merge(uint lane) {
    uint count = TOGETHER + waiting;
    Near own[PARTS];
    uint rank[PARTS];
    for (uint i = 0; i < PARTS; ++i) {
        own[i] = nearest[i * TOGETHER + lane];
        rank[i] = 0;
    }
    for (uint k = 0; k < count; ++k) {
        Near other = nearest[k];
        for (uint i = 0; i < PARTS; ++i) rank[i] += is_before(other, own[i]) ? 1 : 0;
    }
    barrier();
    for (uint i = 0; i < PARTS; ++i) {
        if (i * TOGETHER + lane < count && rank[i] < TOGETHER) nearest[rank[i]] = own[i];
    }
    if (lane == 0) waiting = 0;
    barrier();
}

// Lists the nearest past `last` in their order.
void list_together(Look look, uint lane, uint count, Near last) {
    // Of different indices, so that no two have the same rank.
    nearest[lane] = Near(FARTHEST, NONE - lane);
    if (lane == 0) waiting = 0;
    barrier();
    for (uint first = 0; first < count; first += EXAMINED * TOGETHER) {
        float bound = nearest[TOGETHER - 1].cost;
        CameraState examined[EXAMINED];
        for (uint i = 0; i < EXAMINED; ++i) examined[i] = splats[min(first + i * TOGETHER + lane, count - 1)];
        for (uint i = 0; i < EXAMINED; ++i) {
            vec3 n;
            float d;
            Near next = Near(splat_cost(examined[i], look, bound, n, d), first + i * TOGETHER + lane);
            bool listed = next.view < count && next.cost < bound && is_before(last, next);
            if (listed) nearest[TOGETHER + atomicAdd(waiting, 1)] = next;
        }
        barrier();
        bool due = waiting >= TOGETHER || first + EXAMINED * TOGETHER >= count;
        barrier();
        if (due) merge(lane);
    }
}

// Fills `found` with the three nearest of `count` splats that nothing hides; returns how many there are. All threads of the workgroup
// call it, with the same look.
uint nearest_together(Look look, uint lane, uint count, out Near found[3]) {
    uint have = 0;
    for (uint k = 0; k < 3; ++k) found[k] = NOWHERE;
    Near last = FIRST;
    for (uint tested = 0; tested < LISTED * WALKS && have < 3 && last.cost < FARTHEST; tested += TOGETHER) {
        list_together(look, lane, count, last);
        for (uint begin = 0, end = RAYS; begin < TOGETHER && have < 3; begin = end, end = TOGETHER) {
            if (lane >= begin && lane < end) {
                hidden[lane] = nearest[lane].cost >= FARTHEST || is_hidden(nearest[lane].view, look);
            }
            barrier();
            for (uint k = begin; k < end && have < 3; ++k) {
                if (!hidden[k]) found[have++] = nearest[k];
            }
        }
        last = nearest[TOGETHER - 1];
        barrier();
    }
    return have;
}
