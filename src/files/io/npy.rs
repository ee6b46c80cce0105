//! NumPy's `.npy`: arrays of floating-point numbers, row by row.

use std::path::Path;

use super::binary::Cursor;
use crate::error::{Error, Result};

/// The bytes that such a file begins with.
pub(crate) const SIGNATURE: &[u8; 6] = b"\x93NUMPY";

/// An array whose bytes are all there.
#[derive(Debug)]
pub struct Array<'a> {
    /// Length along each axis.
    pub shape: Vec<usize>,
    /// Bytes of a number: 4 or 8.
    size: usize,
    bytes: &'a [u8],
}

impl Array<'_> {
    /// All numbers, the last axis fastest.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.bytes.chunks_exact(self.size).map(|bytes| match bytes {
            [a, b, c, d] => f64::from(f32::from_le_bytes([*a, *b, *c, *d])),
            _ => f64::from_le_bytes(bytes.try_into().unwrap_or_default()),
        })
    }
}

/// The array of a file.
///
/// # Errors
/// Where the file is no NumPy array of little-endian float32 or float64 in C order, or its bytes are not those of its shape.
pub fn parse<'a>(path: &Path, bytes: &'a [u8]) -> Result<Array<'a>> {
    let refuse = |what: &str| Error::input(path, format!("{what}; write it again with numpy.save"));
    let mut cursor = Cursor::new(path, bytes, 0);
    if cursor.array::<6>("the signature")? != *SIGNATURE {
        return Err(refuse("this is no NumPy file"));
    }
    let [major, _] = cursor.array::<2>("the version")?;
    let length = match major {
        1 => u32::from(u16::from_le_bytes(cursor.array("the header's length")?)),
        _ => cursor.u32("the header's length")?,
    };
    let header = String::from_utf8_lossy(cursor.take(length as usize, "the header")?).replace(' ', "");
    let size = match () {
        () if header.contains("'descr':'<f8'") => 8,
        () if header.contains("'descr':'<f4'") => 4,
        () => {
            let what = "its numbers are neither float64 nor float32; write it again with numpy.save(file, array.astype(numpy.float32))";
            return Err(Error::input(path, what));
        }
    };
    if !header.contains("'fortran_order':False") {
        return Err(refuse("it does not go row by row"));
    }
    let shape = header.split_once("'shape':(").and_then(|(_, rest)| rest.split_once(')')).and_then(|(shape, _)| {
        shape.split(',').filter(|side| !side.is_empty()).map(|side| side.parse().ok()).collect::<Option<Vec<usize>>>()
    });
    let shape = shape.ok_or_else(|| refuse("its header names no shape"))?;
    let wanted = shape.iter().try_fold(size, |bytes: usize, side| bytes.checked_mul(*side));
    let left = cursor.rest().len();
    if wanted != Some(left) {
        return Err(refuse("the file is cut short, or its shape is not that of its header"));
    }
    Ok(Array { shape, size, bytes: &bytes[bytes.len() - left..] })
}

/// A file of an array as numpy writes it.
#[cfg(test)]
pub(crate) fn written(shape: &[usize], values: &[f64]) -> Vec<u8> {
    let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
    let sides = if let [side] = &sides[..] { format!("{side},") } else { sides.join(", ") };
    let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({sides}), }}");
    header += &" ".repeat((64 - (header.len() + 11) % 64) % 64);
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}
