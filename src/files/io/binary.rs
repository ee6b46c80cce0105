//! Bounds-checked reading of little-endian bytes.

use std::path::Path;

use crate::error::{Error, Result};

/// A position in the bytes of a file. Nothing is ever read past the end: a cut-off file becomes an error that names the
/// byte offset, and counts are checked against the bytes that are left before anything is allocated for them.
pub(crate) struct Cursor<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    /// Starts at byte `at` of `bytes`; `path` is for messages only.
    pub fn new(path: &'a Path, bytes: &'a [u8], at: usize) -> Self {
        Self { path, bytes, at: at.min(bytes.len()) }
    }

    /// The bytes not yet read.
    pub fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    /// An error about the cursor's position.
    pub fn error(&self, what: impl std::fmt::Display) -> Error {
        Error::input(self.path, format!("byte {}: {what}", self.at))
    }

    /// The next `length` bytes; `what` names them in the message.
    pub fn take(&mut self, length: usize, what: impl std::fmt::Display) -> Result<&'a [u8]> {
        let rest = self.rest();
        let Some(taken) = rest.get(..length) else {
            return Err(self.error(format!(
                "the file is cut short: {what} takes {length} bytes and {} are left; copy or export it again",
                rest.len()
            )));
        };
        self.at += length;
        Ok(taken)
    }

    /// The next `N` bytes as an array.
    pub fn array<const N: usize>(&mut self, what: impl std::fmt::Display) -> Result<[u8; N]> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, what)?);
        Ok(array)
    }

    /// Next u32.
    pub fn u32(&mut self, what: impl std::fmt::Display) -> Result<u32> {
        Ok(u32::from_le_bytes(self.array(what)?))
    }

    /// Next u64.
    pub fn u64(&mut self, what: impl std::fmt::Display) -> Result<u64> {
        Ok(u64::from_le_bytes(self.array(what)?))
    }

    /// Next f64.
    pub fn f64(&mut self, what: impl std::fmt::Display) -> Result<f64> {
        Ok(f64::from_le_bytes(self.array(what)?))
    }

    /// Next u64 as a count of things that take `least` bytes each or more; an error where the file is too short to hold
    /// them, so that the count is safe to allocate for.
    pub fn count(&mut self, least: usize, what: impl std::fmt::Display) -> Result<usize> {
        let count = self.u64(&what)?;
        let left = self.rest().len();
        match usize::try_from(count).ok().filter(|&n| n.checked_mul(least).is_some_and(|bytes| bytes <= left)) {
            Some(count) => Ok(count),
            None => Err(self.error(format!(
                "the file is cut short or damaged: it announces {count} {what} and {left} bytes are left; copy or \
                 export it again"
            ))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a damaged count could make the reader allocate memory for things that are not in the file.
    #[test]
    fn a_count_beyond_the_bytes_left_is_refused() {
        let mut bytes = 1_000_000_000_000u64.to_le_bytes().to_vec();
        bytes.extend([0; 64]);
        let message = Cursor::new(Path::new("a.bin"), &bytes, 0).count(8, "images").unwrap_err().to_string();
        assert!(message.contains("1000000000000 images") && message.contains("64 bytes are left"), "{message}");
    }

    /// If this failed, a truncated file would be reported without the place where it ends.
    #[test]
    fn a_short_read_names_its_offset() {
        let mut cursor = Cursor::new(Path::new("a.bin"), &[1, 0, 0, 0, 5], 0);
        assert_eq!(cursor.u32("id").unwrap(), 1);
        assert!(cursor.u32("width").unwrap_err().to_string().contains("byte 4"));
    }
}
