// What the two stages of a sort by sweeps share: tiles of keys, one per workgroup, groups of tiles, and digits of at most 8 bits.
const uint DIGITS = 256;
const uint PASSES = 4;
layout(constant_id = 1) const uint ITEMS = 16;
// Keys of a workgroup.
const uint TILE = ITEMS * gl_WorkGroupSize.x;
// Tiles of a group.
const uint GROUP = 8;
// Where in `header` the keys of each digit are counted, pass after pass; before it, a counter of tiles for each pass.
const uint TOTALS = PASSES;
