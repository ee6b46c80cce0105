// Exclusive prefix sums over the threads of a workgroup; define LINE (uint, uvec2 or uvec4: one sum per component) first.
//
// Each step adds three neighbours, so 256 threads take four steps and not eight: barriers, not additions, are what a
// scan through shared memory waits for. No subgroup operation takes part, so nothing depends on the subgroup's size.
shared LINE line[2][gl_WorkGroupSize.x];

LINE line_scan(uint thread, LINE value, out LINE total) {
    uint from = 0;
    line[0][thread] = value;
    barrier();
    for (uint reach = 1; reach < gl_WorkGroupSize.x; reach *= 4) {
        LINE sum = line[from][thread];
        for (uint back = reach; back <= min(3 * reach, thread); back += reach) {
            sum += line[from][thread - back];
        }
        from = 1 - from;
        line[from][thread] = sum;
        barrier();
    }
    LINE before = line[from][thread] - value;
    total = line[from][gl_WorkGroupSize.x - 1];
    // The next call may overwrite what another thread has yet to read.
    barrier();
    return before;
}
