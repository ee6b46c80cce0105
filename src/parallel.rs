//! Work shared among threads so that the result does not depend on how many there are: every chunk has one writer.

use rayon::prelude::*;

/// Calls `work` with the index and the contents of every chunk of `length` items, on as many threads as the machine has.
pub fn in_parallel<T: Send>(items: &mut [T], length: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    items.par_chunks_mut(length.max(1)).enumerate().for_each(|(index, chunk)| work(index, chunk));
}

/// As [`in_parallel`], with something that `scratch` makes, which one thread uses for some of the chunks.
pub fn with_scratch<T: Send, S>(
    items: &mut [T],
    length: usize,
    scratch: impl Fn() -> S + Sync,
    work: impl Fn(usize, &mut [T], &mut S) + Sync,
) {
    let chunks = items.par_chunks_mut(length.max(1)).enumerate();
    chunks.for_each_init(&scratch, |scratch, (index, chunk)| work(index, chunk, scratch));
}
