// What the two stages of a radix pass share: a tile of keys per workgroup, one digit of each key.
const uint DIGITS = 256;
// Keys per thread; `KEYS_PER_THREAD` in radix_sort.rs.
const uint ITEMS = 16;
const uint TILE = ITEMS * gl_WorkGroupSize.x;

layout(push_constant) uniform Push {
    uint count;
    uint count_index;
    // Lowest bit of the digit, and a mask as wide as the digit (at most 8 bits).
    uint shift;
    uint mask;
    // Tiles from one digit's row of the table to the next digit's.
    uint stride;
};

uint digit(uint key) {
    return (key >> shift) & mask;
}
