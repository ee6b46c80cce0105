//! Work shared among threads so that the result does not depend on how many there are: every chunk has one writer.

use std::sync::Mutex;

/// Calls `work` with the index and the contents of every chunk of `length` items, on as many threads as the machine has.
pub fn in_parallel<T: Send>(items: &mut [T], length: usize, work: impl Fn(usize, &mut [T]) + Sync) {
    with_scratch(items, length, || (), |index, chunk, ()| work(index, chunk));
}

/// As [`in_parallel`], with something of its own for each thread that `scratch` makes.
pub fn with_scratch<T: Send, S>(
    items: &mut [T],
    length: usize,
    scratch: impl Fn() -> S + Sync,
    work: impl Fn(usize, &mut [T], &mut S) + Sync,
) {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(items.len().div_ceil(length.max(1)));
    let chunks = Mutex::new(items.chunks_mut(length.max(1)).enumerate());
    // A poisoned lock means that another thread panicked, which the scope passes on.
    let next = || chunks.lock().ok().and_then(|mut chunks| chunks.next());
    let run = || {
        let mut scratch = scratch();
        while let Some((index, chunk)) = next() {
            work(index, chunk, &mut scratch);
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads {
            scope.spawn(run);
        }
        run();
    });
}
