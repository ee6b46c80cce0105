//! Photos that say where on Earth they were taken.

use std::io::Cursor;

/// The bytes of a JPEG with a position in its EXIF data.
pub fn jpeg_at(picture: &image::RgbImage, latitude: f64, longitude: f64, altitude: f64) -> Vec<u8> {
    let mut plain = Cursor::new(Vec::new());
    picture.write_to(&mut plain, image::ImageFormat::Jpeg).unwrap();
    // TIFF, little-endian: an entry that leads to the GPS data, these (references, and rationals that follow), then the numbers.
    let mut tiff = b"II*\0\x08\0\0\0\x01\0\x25\x88\x04\0\x01\0\0\0\x1a\0\0\0\0\0\0\0".to_vec();
    let numbers_at = 26 + 2 + 6 * 12 + 4;
    tiff.extend(6u16.to_le_bytes());
    let mut entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
        tiff.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        tiff.extend(count.to_le_bytes());
        tiff.extend(value);
    };
    let place = |i: u32| (numbers_at + 24 * i).to_le_bytes();
    entry(1, 2, 2, if latitude < 0.0 { *b"S\0\0\0" } else { *b"N\0\0\0" });
    entry(2, 5, 3, place(0));
    entry(3, 2, 2, if longitude < 0.0 { *b"W\0\0\0" } else { *b"E\0\0\0" });
    entry(4, 5, 3, place(1));
    entry(5, 1, 1, [u8::from(altitude < 0.0), 0, 0, 0]);
    entry(6, 5, 1, place(2));
    tiff.extend([0; 4]);
    let mut rational = |value: f64, parts: u32| {
        tiff.extend(((value * f64::from(parts)).round() as u32).to_le_bytes());
        tiff.extend(parts.to_le_bytes());
    };
    for degrees in [latitude.abs(), longitude.abs()] {
        let minutes = degrees.fract() * 60.0;
        rational(degrees.trunc(), 1);
        rational(minutes.trunc(), 1);
        rational(minutes.fract() * 60.0, 100_000);
    }
    rational(altitude.abs(), 1000);
    let exif = [&b"Exif\0\0"[..], &tiff].concat();
    let mut bytes = plain.into_inner();
    let segment = [&b"\xff\xe1"[..], &(exif.len() as u16 + 2).to_be_bytes(), &exif].concat();
    bytes.splice(2..2, segment);
    bytes
}
