//! What the first bytes of an image file say.

use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;

use image::{ImageDecoder, ImageError, ImageFormat, ImageReader};

/// Size of an image as it is stored, and what decoding it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Bytes per pixel that it decodes to, at most.
    pub pixel_bytes: u64,
    /// Bytes per pixel that the decoder needs besides, at most.
    pub scratch_bytes: u64,
}

impl Header {
    /// Reads the header of a PNG or JPEG file, and no more of it.
    ///
    /// # Errors
    /// When the file cannot be opened, or is damaged or of another format.
    pub fn read(path: &Path) -> Result<Self, ImageError> {
        let reader = ImageReader::open(path)?.with_guessed_format()?;
        if reader.format() == Some(ImageFormat::Jpeg) {
            // The decoder reads a whole JPEG before it tells anything.
            return Ok(Self::of_jpeg(&mut BufReader::new(File::open(path)?))?);
        }
        let decoder = reader.into_decoder()?;
        let (width, height) = decoder.dimensions();
        Ok(Self { width, height, pixel_bytes: u64::from(decoder.color_type().bytes_per_pixel()), scratch_bytes: 0 })
    }

    /// Reads segments of a JPEG up to the start of its frame (ITU-T T.81, annex B).
    fn of_jpeg(file: &mut (impl Read + Seek)) -> std::io::Result<Self> {
        let bytes = |file: &mut dyn Read| -> std::io::Result<[u8; 2]> {
            let mut two = [0; 2];
            file.read_exact(&mut two)?;
            Ok(two)
        };
        bytes(file)?;
        loop {
            let mut marker = bytes(file)?;
            // Any number of 0xff may stand before a marker.
            while marker == [0xff, 0xff] {
                file.read_exact(&mut marker[1..])?;
            }
            let length = u16::from_be_bytes(bytes(file)?);
            let is_frame = matches!(marker[1], 0xc0..=0xcf) && !matches!(marker[1], 0xc4 | 0xc8 | 0xcc);
            if marker[0] != 0xff || length < 2 {
                return Err(std::io::Error::new(std::io::ErrorKind::InvalidData, "the JPEG header is damaged"));
            }
            if is_frame {
                let mut frame = [0; 6];
                file.read_exact(&mut frame)?;
                let [_, h1, h0, w1, w0, _] = frame;
                let size = |high, low| u32::from(u16::from_be_bytes([high, low]));
                // A progressive JPEG keeps 16-bit coefficients of three channels until its end.
                let scratch_bytes = if matches!(marker[1], 0xc0 | 0xc1) { 0 } else { 6 };
                return Ok(Self { width: size(w1, w0), height: size(h1, h0), pixel_bytes: 3, scratch_bytes });
            }
            file.seek_relative(i64::from(length) - 2)?;
        }
    }
}
