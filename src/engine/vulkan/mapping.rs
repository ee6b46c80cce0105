//! Memory that host and device both see.

use std::ptr::NonNull;
use std::sync::Mutex;

use crate::engine::parallel::lock;

/// Mapped memory of a buffer. The device may write it at any time, so that no reference to it is ever made: values are copied in and out
/// by raw pointers, by one thread of the host at a time.
pub(super) struct Mapping {
    start: Mutex<Start>,
    size: usize,
}

struct Start(NonNull<u8>);

// SAFETY: the memory belongs to no thread; all access goes through the lock.
unsafe impl Send for Start {}

impl Mapping {
    /// The `size` bytes from `start` on.
    ///
    /// # Safety
    /// They must be readable and writable, and aligned for `u32`, as long as the mapping lives, and the host must reach them by nothing
    /// else.
    pub(super) unsafe fn new(start: NonNull<u8>, size: usize) -> Self {
        Self { start: Mutex::new(Start(start)), size }
    }

    /// Copies `into.len()` bytes from byte `first` on; false, with nothing copied, where the mapping has fewer.
    pub(super) fn read(&self, first: usize, into: &mut [u8]) -> bool {
        let inside = self.has(first, into.len());
        if inside {
            let start = lock(&self.start);
            // SAFETY: the range lies inside the mapping, as `has` found; `into` is ours alone.
            unsafe { start.0.as_ptr().add(first).copy_to_nonoverlapping(into.as_mut_ptr(), into.len()) };
        }
        inside
    }

    /// Copies `from` to the bytes from `first` on; false, with nothing copied, where the mapping has fewer.
    pub(super) fn write(&self, first: usize, from: &[u8]) -> bool {
        let inside = self.has(first, from.len());
        if inside {
            let start = lock(&self.start);
            // SAFETY: as in `read`; nobody has a reference to the mapping.
            unsafe { start.0.as_ptr().add(first).copy_from_nonoverlapping(from.as_ptr(), from.len()) };
        }
        inside
    }

    /// Reads the word of that index, whole, even while the device writes it; `None` outside the mapping.
    pub(super) fn peek(&self, index: usize) -> Option<u32> {
        let first = self.word(index)?;
        let start = lock(&self.start);
        // SAFETY: the word lies inside the mapping and is aligned, as its start is.
        Some(unsafe { start.0.add(first).cast::<u32>().read_volatile() })
    }

    /// Writes the word of that index, whole, even while the device reads it; does nothing outside the mapping.
    pub(super) fn poke(&self, index: usize, value: u32) {
        if let Some(first) = self.word(index) {
            let start = lock(&self.start);
            // SAFETY: as in `peek`.
            unsafe { start.0.add(first).cast::<u32>().write_volatile(value) };
        }
    }

    fn has(&self, first: usize, bytes: usize) -> bool {
        first.checked_add(bytes).is_some_and(|end| end <= self.size)
    }

    fn word(&self, index: usize) -> Option<usize> {
        index.checked_mul(4).filter(|first| self.has(*first, 4))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, safe code could read or write memory outside a buffer, or two threads of the host could race for it; Miri checks
    /// both here (`cargo miri test mapping`), where it is installed.
    #[test]
    fn nothing_outside_is_reached_whatever_is_asked_for_and_threads_take_turns() {
        let mut words = [0u32; 8];
        // SAFETY: the array outlives the mapping, and nothing else uses it until that is gone.
        let mapping = unsafe { Mapping::new(NonNull::from(&mut words).cast(), 24) };
        std::thread::scope(|scope| {
            for thread in 0..4u32 {
                let mapping = &mapping;
                scope.spawn(move || {
                    assert!(mapping.write(4, &[thread as u8; 12]));
                    let mut seen = [0; 12];
                    assert!(mapping.read(4, &mut seen));
                    assert!(
                        seen.iter().all(|byte| *byte == seen[0]),
                        "half of one thread's, half of another's: {seen:?}"
                    );
                    mapping.poke(5, thread);
                    assert!(mapping.peek(5).is_some_and(|word| word < 4));
                });
            }
        });
        assert!(!mapping.write(16, &[1; 9]) && !mapping.read(25, &mut []) && !mapping.read(usize::MAX, &mut [0; 2]));
        assert_eq!((mapping.peek(6), mapping.peek(usize::MAX / 4), mapping.peek(usize::MAX)), (None, None, None));
        mapping.poke(6, 7);
        mapping.poke(usize::MAX / 4 + 2, 7);
        assert!(mapping.read(24, &mut []) && mapping.write(0, &[]));
        assert_eq!([words[0], words[6], words[7]], [0; 3]);
    }
}
