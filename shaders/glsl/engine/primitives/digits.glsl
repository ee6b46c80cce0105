// What the stages of a radix pass share: one digit of each key.
const uint DIGITS = 256;

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
