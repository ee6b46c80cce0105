//! Work shared among threads so that the result does not depend on how many there are: every chunk has one writer.

use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

use crate::{Error, Result};

/// Locks a mutex whose contents stay valid whatever a panicking thread did.
pub fn lock<T: ?Sized>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Threads that work may use here: as many as the machine has, or the share of them that [`on_a_share`] gives.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// Does `work` with one of `parts` equal shares of the machine's threads, so that others that do the same do not get in its way.
///
/// # Errors
/// As `work`, or where the system gives no threads.
pub fn on_a_share<T: Send>(parts: usize, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
    if parts <= 1 {
        return work();
    }
    let share = rayon::ThreadPoolBuilder::new().num_threads((threads() / parts).max(1)).build();
    share.map_err(|e| Error::request(format!("the system gives no threads ({e})")))?.install(work)
}

/// Does `there` on other threads while `here` runs on this one, where there are others; this thread does both otherwise.
pub fn beside<T: Send, H>(there: impl FnOnce() -> T + Send, here: impl FnOnce() -> H) -> (T, H) {
    let mut made = None;
    let here = rayon::in_place_scope(|scope| {
        scope.spawn(|_| made = Some(there()));
        here()
    });
    // The scope ends once all that was spawned in it has, and passes its panics on.
    (made.expect("what was spawned has ended"), here)
}

/// What `work` makes of the index and each of the items, in their order.
pub fn mapped<T: Sync, R: Send>(items: &[T], work: impl Fn(usize, &T) -> R + Sync) -> Vec<R> {
    items.par_iter().enumerate().map(|(index, item)| work(index, item)).collect()
}

/// Calls `work` with every item; the first failure in time ends it, after other threads finish their current items.
///
/// # Errors
/// As `work`.
pub fn try_each<T: Sync>(items: &[T], work: impl Fn(&T) -> Result<()> + Sync + Send) -> Result<()> {
    items.par_iter().try_for_each(work)
}

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

#[cfg(test)]
mod tests {
    use super::*;

    /// A worker's share can be a single thread: waiting for another one would then never end.
    #[test]
    fn work_beside_other_work_is_done_with_one_thread_too() {
        for parts in [1, 1000] {
            let both = on_a_share(parts, || Ok(beside(|| mapped(&[1, 2], |_, n| 2 * n), || "here"))).unwrap();
            assert_eq!(both, (vec![2, 4], "here"));
        }
    }

    /// If this failed, concurrent workers would each take all threads.
    #[test]
    fn a_share_is_a_part_of_the_threads() {
        let all = threads();
        assert_eq!(on_a_share(1, || Ok(threads())).unwrap(), all);
        assert_eq!(on_a_share(2, || Ok(threads())).unwrap(), (all / 2).max(1));
        assert_eq!(on_a_share(1000, || Ok(mapped(&[1, 2, 3], |i, n| i + n))).unwrap(), [1, 3, 5]);
        assert!(on_a_share(2, || Err::<(), _>(Error::request("no"))).is_err());
    }
}
