//! The header of an image file.

use std::fs::File;
use std::io::{BufReader, ErrorKind, Read, Seek};
use std::path::Path;

use image::{ImageDecoder, ImageError, ImageFormat, ImageReader};

/// Size of an image as it is stored, and what decoding it takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Whether it has an alpha channel.
    pub alpha: bool,
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
            // The decoder reads a whole JPEG before it reports anything.
            return Ok(Self::of_jpeg(&mut BufReader::new(File::open(path)?))?);
        }
        let decoder = reader.into_decoder()?;
        let (width, height) = decoder.dimensions();
        let colour = decoder.color_type();
        let pixel_bytes = u64::from(colour.bytes_per_pixel());
        Ok(Self { width, height, alpha: colour.has_alpha(), pixel_bytes, scratch_bytes: 0 })
    }

    /// Reads the segments of a JPEG up to its first scan (ITU-T T.81, annex B).
    fn of_jpeg(file: &mut (impl Read + Seek)) -> std::io::Result<Self> {
        let damaged = || std::io::Error::new(ErrorKind::InvalidData, "the JPEG header is damaged");
        let mut frame: Option<(u8, [u8; 6])> = None;
        // Past the mark of the file's start.
        file.seek_relative(2)?;
        loop {
            let mut marker = [0; 2];
            file.read_exact(&mut marker)?;
            // Any number of 0xff may precede a marker.
            while marker == [0xff, 0xff] {
                file.read_exact(&mut marker[1..])?;
            }
            let mut length = [0; 2];
            file.read_exact(&mut length)?;
            let left = i64::from(u16::from_be_bytes(length)) - 2;
            if marker[0] != 0xff || left < 0 {
                return Err(damaged());
            }
            match (marker[1], frame) {
                (0xc0..=0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf, None) => {
                    let mut start = [0; 6];
                    file.read_exact(&mut start)?;
                    frame = Some((marker[1], start));
                    file.seek_relative(left - 6)?;
                }
                (0xda, Some((kind, [_, h1, h0, w1, w0, components]))) => {
                    let mut scanned = [0];
                    file.read_exact(&mut scanned)?;
                    let size = |high, low| u32::from(u16::from_be_bytes([high, low]));
                    let (width, height) = (size(w1, w0), size(h1, h0));
                    if width == 0 || height == 0 {
                        return Err(damaged());
                    }
                    // Where the first scan does not complete the picture, decoders keep 16-bit coefficients to the end.
                    let at_once = matches!(kind, 0xc0 | 0xc1) && scanned[0] == components;
                    let scratch_bytes = if at_once { 0 } else { 2 * u64::from(components) };
                    return Ok(Self { width, height, alpha: false, pixel_bytes: 3, scratch_bytes });
                }
                (0xda, None) => return Err(damaged()),
                _ => file.seek_relative(left)?,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    /// Start of file, a comment, a frame of 300 x 200 pixels with three components, and the head of a scan of `scanned`.
    fn jpeg(frame: u8, scanned: u8, width: u8) -> Vec<u8> {
        let mut bytes = vec![0xff, 0xd8, 0xff, 0xff, 0xfe, 0, 4, 0xff, 0xc0];
        bytes.extend([0xff, frame, 0, 17, 8, 0, 200, width, 44, 3, 1, 0x11, 0, 2, 0x11, 0, 3, 0x11, 0]);
        bytes.extend([0xff, 0xda, 0, 12, scanned]);
        bytes
    }

    fn read(bytes: &[u8]) -> std::io::Result<Header> {
        Header::of_jpeg(&mut Cursor::new(bytes))
    }

    /// If this failed, progressive photos would take more memory than was set aside, or a size be read out of a comment.
    #[test]
    fn scratch_depends_on_the_first_scan() {
        let whole = Header { width: 300, height: 200, alpha: false, pixel_bytes: 3, scratch_bytes: 0 };
        assert_eq!(read(&jpeg(0xc0, 3, 1)).unwrap(), whole);
        assert_eq!(read(&jpeg(0xc2, 3, 1)).unwrap(), Header { scratch_bytes: 6, ..whole });
        assert_eq!(read(&jpeg(0xc0, 1, 1)).unwrap(), Header { scratch_bytes: 6, ..whole });
    }

    /// If this failed, a damaged header would be read as some size, or loop forever.
    #[test]
    fn damaged_headers_are_refused() {
        let bytes = jpeg(0xc0, 3, 1);
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length} bytes");
        }
        let without_width = bytes.iter().map(|byte| if [1, 44].contains(byte) { 0 } else { *byte }).collect::<Vec<_>>();
        assert!(read(&without_width).is_err());
        assert!(read(&[0xff, 0xd8, 0xff, 0xe0, 0, 1, 0, 0]).is_err());
    }

    /// If this failed, the size that photos are judged by would be another one than they decode to.
    #[test]
    fn headers_say_what_is_decoded() {
        let folder = tempfile::tempdir().unwrap();
        for (name, pixel_bytes) in [("a.jpg", 3), ("a.png", 3)] {
            let path = folder.path().join(name);
            image::RgbImage::new(17, 9).save(&path).unwrap();
            let known = Header { width: 17, height: 9, alpha: false, pixel_bytes, scratch_bytes: 0 };
            assert_eq!(Header::read(&path).unwrap(), known);
        }
        let path = folder.path().join("b.png");
        image::RgbaImage::new(3, 4).save(&path).unwrap();
        assert_eq!(Header::read(&path).unwrap().pixel_bytes, 4);
        std::fs::write(&path, "no image").unwrap();
        assert!(Header::read(&path).is_err());
    }
}
