//! What both ways of a radix pass share: the digits of a sort, and where its elements are.

use crate::engine::vulkan::Buffer;

/// Where sorted elements are: in the caller's buffers after an even number of passes, else in the sorter's, where what
/// lies behind the counted elements means nothing.
#[derive(Clone, Copy)]
pub struct Sorted<'a> {
    /// The keys.
    pub keys: &'a Buffer,
    /// Their values.
    pub values: &'a Buffer,
}

/// Bits of the keys that a pass sorts by.
#[derive(Clone, Copy)]
pub(super) struct Digit {
    /// The lowest.
    pub shift: u32,
    /// As many ones as there are.
    pub mask: u32,
}

/// Passes that a sort by `bits` bits takes.
pub(super) fn passes(bits: u32) -> u32 {
    bits.div_ceil(8)
}

/// Bits of a digit. Digits are of equal width: few distinct digits make long runs, which are cheaper to write.
pub(super) fn width(bits: u32) -> u32 {
    bits.div_ceil(passes(bits))
}

/// The digits of a sort by `bits` bits (1 to 32), the lowest first.
pub(super) fn digits(bits: u32) -> impl Iterator<Item = Digit> {
    let width = width(bits);
    (0..bits).step_by(width as usize).map(move |shift| Digit { shift, mask: (1 << width.min(bits - shift)) - 1 })
}
