//! Parallel primitives: scan, radix sort, ranges of keys, reduce; copy and arithmetic as yardsticks. Nothing here knows of splats.
//!
//! Each owns its pipelines and scratch, made once for a largest number of elements, and records into the caller's
//! [`Recorder`](crate::engine::vulkan::Recorder). How many elements there are may be known to the host or only to the device
//! ([`Count`]); nothing is ever read back. Results depend on the input alone: not on the subgroup size, the scheduling
//! or the number of threads. [`twin`] holds the same functions in plain Rust.
//!
//! ```no_run
//! use camsplat::engine::primitives::{Count, RadixSort};
//! use camsplat::engine::vulkan::{Buffer, Context, ContextOptions, Recorder};
//!
//! let context = Context::new(&ContextOptions::default())?;
//! let depths = Buffer::from_slice(&context, "depths", &[0.5f32, 2.0, 0.25])?;
//! let splats = Buffer::from_slice(&context, "splats", &[0u32, 1, 2])?;
//! let sort = RadixSort::new(&context, 3)?;
//! let mut recorder = Recorder::new(&context)?;
//! let sorted = sort.pairs(&mut recorder, &depths, &splats, Count::Host(3), 32)?;
//! recorder.submit_and_wait()?;
//! assert_eq!(sorted.values.download::<u32>(3)?, [2, 0, 1]);
//! # Ok::<(), camsplat::Error>(())
//! ```

mod arithmetic;
mod copy;
mod count;
mod counted;
mod digits;
mod key_ranges;
mod radix_sort;
mod reduce;
mod scan;
mod sweep;
pub mod twin;

pub use arithmetic::Arithmetic;
pub use copy::Copy;
pub use count::Count;
pub use digits::Sorted;
pub use key_ranges::KeyRanges;
pub use radix_sort::RadixSort;
pub use reduce::{Operation, Reduce};
pub use scan::Scan;
