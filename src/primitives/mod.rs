//! Parallel primitives: scan, radix sort, reduce. Nothing here knows of splats.
