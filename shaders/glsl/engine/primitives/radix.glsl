// What the two stages of a radix pass share: a tile of keys per workgroup, one digit of each key.
#include "engine/primitives/digits.glsl"
// Keys per thread; `KEYS_PER_THREAD` in counted.rs.
const uint ITEMS = 16;
const uint TILE = ITEMS * gl_WorkGroupSize.x;
