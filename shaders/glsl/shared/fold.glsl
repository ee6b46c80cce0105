// Folds what the threads of a workgroup have put into shared memory onto the first one, in an order that depends on nothing but
// `width`, a power of two:
//
//     sums[thread] = value;
//     FOLD(thread, 64, sums[thread] += sums[thread + apart]);
//
// Uniform control flow. All threads may read the result after one more barrier, the first at once.
#define FOLD(index, width, step) for (uint apart = (width) / 2; apart > 0; apart >>= 1) { barrier(); if ((index) < apart) { step; } }
