//! Device memory of a run, by buffer, known before anything is allocated.

use std::sync::Arc;

use super::buffer::Buffer;
use super::context::Context;
use crate::{Error, Result};

/// The buffer of that name, in device memory, of a list of names and bytes.
///
/// # Errors
/// A name that is not in the list; otherwise as [`Buffer::device`].
pub fn buffer(context: &Arc<Context>, list: &[(&'static str, u64)], name: &str) -> Result<Buffer> {
    Buffer::device(context, name, bytes_of(list, name)?)
}

fn bytes_of(list: &[(&'static str, u64)], name: &str) -> Result<u64> {
    let found = list.iter().find(|buffer| buffer.0 == name);
    found.map(|buffer| buffer.1).ok_or_else(|| Error::request(format!("the footprint knows no buffer {name:?}")))
}

/// Buffers by name and size, in bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct Footprint {
    /// Name and bytes of every buffer.
    pub buffers: Vec<(&'static str, u64)>,
    /// Names of entries that cover several buffers, none of which is the whole.
    pub several: Vec<&'static str>,
}

impl Footprint {
    /// Bytes of a buffer.
    ///
    /// # Errors
    /// A name that is not in the list.
    pub fn bytes_of(&self, name: &str) -> Result<u64> {
        bytes_of(&self.buffers, name)
    }

    /// Bytes of all buffers.
    pub fn total(&self) -> u64 {
        self.buffers.iter().map(|buffer| buffer.1).sum()
    }

    /// Checks the footprint of `what` ("the plan") against the device; `remedy` gives the remedy for the buffer of that name.
    ///
    /// # Errors
    /// Where the whole does not fit the memory that is free, or one buffer is larger than the device allows.
    pub fn check(&self, context: &Context, what: &str, remedy: impl Fn(&str) -> &'static str) -> Result<()> {
        let physical = context.physical();
        let limit = physical.storage_range.min(physical.allocation);
        let free = context.memory_available();
        let largest = |single: bool| {
            let counted = self.buffers.iter().filter(|buffer| !(single && self.several.contains(&buffer.0)));
            counted.max_by_key(|buffer| buffer.1)
        };
        let Some((name, bytes)) = largest(true).filter(|buffer| buffer.1 > limit).or(largest(false)) else {
            return Ok(());
        };
        let (what, wanted, available) = if *bytes > limit && !self.several.contains(name) {
            (
                format!("{what}'s buffer {name:?} (this device shows a shader {limit} bytes of one at most)"),
                *bytes,
                limit,
            )
        } else if self.total() > free {
            (what.to_owned(), self.total(), free)
        } else {
            return Ok(());
        };
        Err(Error::OutOfMemory { what, wanted, available, remedy: remedy(name).into() })
    }

    /// The table that `--dry-run` prints.
    pub fn table(&self) -> String {
        let mut text = String::new();
        for (name, bytes) in &self.buffers {
            text += &format!("{name:<20} {:>10.2} MiB\n", *bytes as f64 / f64::from(1 << 20));
        }
        text + &format!("{:<20} {:>10.2} MiB\n", "all", self.total() as f64 / f64::from(1 << 20))
    }
}
