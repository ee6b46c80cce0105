//! How many elements a primitive works on.

use crate::engine::vulkan::Buffer;
use crate::{Error, Result};

/// How many elements there are.
#[derive(Clone, Copy)]
pub enum Count<'a> {
    /// The host's number.
    Host(u32),
    /// As many as the device finds in this buffer, at this `u32` index, when the stages run; at most as many as the
    /// primitive was made for and its buffers hold. Workgroups without elements end at once.
    Device(&'a Buffer, u32),
}

/// A count as the shaders take it.
#[derive(Clone, Copy)]
pub(super) struct Bound<'a> {
    /// The count, or the most that it can be.
    pub count: u32,
    /// Where the device finds it; all ones where `count` is the count.
    pub index: u32,
    /// What to bind as `counts`.
    pub buffer: &'a Buffer,
}

impl<'a> Count<'a> {
    /// Holds the count against `most` elements and against the buffers, of 4 bytes an element; `buffers` is not empty.
    pub(super) fn within(self, most: u32, buffers: &[&'a Buffer]) -> Result<Bound<'a>> {
        let held = buffers.iter().map(|buffer| buffer.size() / 4).fold(most as u64, u64::min) as u32;
        match self {
            Self::Host(count) if count > held => {
                Err(Error::request(format!("{count} elements in {:?}, which holds {held}", buffers[0].name())))
            }
            Self::Host(count) => Ok(Bound { count, index: u32::MAX, buffer: buffers[0] }),
            Self::Device(buffer, index) => {
                check_index(buffer, index)?;
                Ok(Bound { count: held, index, buffer })
            }
        }
    }
}

/// Indices, sums and loops of the shaders are good for 2²⁸ elements.
pub(super) fn check_most(most: u32) -> Result<()> {
    if most > 1 << 28 {
        return Err(Error::request(format!("{most} elements are more than the 2^28 that the primitives take")));
    }
    Ok(())
}

/// A `u32` index must lie inside its buffer.
pub(super) fn check_index(buffer: &Buffer, index: u32) -> Result<()> {
    if index as u64 >= buffer.size() / 4 {
        return Err(Error::request(format!("the buffer {:?} has no element {index}", buffer.name())));
    }
    Ok(())
}
