// Perturbations of parameters, for manifold sampling. Twin: `perturbation` in src/splats/uncertainty/manifold.rs. Needs random.glsl.

const uint PERTURBATION_STREAM = 0x4d530000u;

// A permutation in which every bit is turned by the bits below it alone (Laine and Karras 2011, as Burley 2020 has it).
uint permuted(uint x, uint key) {
    x += key;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    return x ^ x * 0x8d22f6e6u;
}

// Number `draw` of a parameter's own sequence in [-1, 1): the first dimension of Sobol's, with the order and the digits
// scrambled by keys of the parameter (Burley, "Practical Hash-based Owen Scrambling", 2020): Sobol's has too few dimensions for
// all parameters, and those of a dimension would move together.
float perturbation(uvec2 seed, uint parameter, uint draw) {
    uvec4 keys = pcg4d(uvec4(seed, PERTURBATION_STREAM, parameter));
    // Reversed twice: once for Sobol's first dimension, once for the order.
    uint point = permuted(bitfieldReverse(draw), keys.x);
    uint digits = bitfieldReverse(permuted(bitfieldReverse(point), keys.y));
    return float(digits >> 8) * 1.1920928955078125e-7 - 1.0;
}
