//! SPZ, the compressed splats of Niantic (github.com/nianticlabs/spz, README): all values in fixed point, column by column. Versions 2 and
//! 3 are one stream of gzip, version 4 has a stream of Zstandard for each column.
//!
//! Axes are those of the model, as Niantic's own converters and others write it, though the format's page prefers right, up, back.

use std::io::{Read, Write};
use std::path::Path;

use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use glam::DVec3;

use super::order::along_morton;
use super::quantised::{byte, from_smallest_three, logit, smallest_three};
use super::usable::usable;
use crate::error::{Error, Result};
use crate::files::io::binary::Cursor;
use crate::scene::gaussians::{Gaussians, MAX_DEGREE, coefficients};

/// The first bytes of a file, compressed or not.
const MAGIC: &[u8; 4] = b"NGSP";
pub(super) const GZIP: &[u8; 2] = &[0x1f, 0x8b];
/// Bytes of the header, of version 4 too.
const HEADER: usize = 16;
const LONG_HEADER: usize = 32;
/// Flags of the header.
const ANTIALIASED: u8 = 1;
const EXTENDED: u8 = 2;
/// Steps of a constant harmonic: eight bits hold more than the colours of [0, 1].
const COLOUR: f64 = 0.15;
/// Steps between the values that harmonics are rounded to, of degree 1 and above, for the sake of compression (the format's defaults).
const ROUNDED: [i32; 2] = [8, 16];
/// How much smaller compression can make a file: what a header announces beyond this is not there.
const SMALLEST: usize = 1100;

/// Whether a file is one of these.
pub(super) fn is_spz(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC) || bytes.starts_with(GZIP)
}

/// What a header says.
struct Header {
    version: u32,
    count: usize,
    /// Of the harmonics, up to 4.
    degree: u32,
    /// Bits after the point of positions.
    fraction: u32,
    flags: u8,
}

/// The columns: positions, opacities, colours, scales, rotations, harmonics.
type Columns = [Vec<u8>; 6];

impl Header {
    /// Bytes of each column.
    fn lengths(&self) -> [usize; 6] {
        let rotation = if self.version == 2 { 3 } else { 4 };
        [9, 1, 3, 3, rotation, 3 * (coefficients(self.degree) - 1)].map(|each| each * self.count)
    }
}

/// Reads the bytes of a file.
///
/// # Errors
/// Where it is damaged, cut short or of another version, or holds no splats that can be used.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Gaussians> {
    let (header, columns) = if bytes.starts_with(GZIP) { gzip(path, bytes)? } else { streams(path, bytes)? };
    if header.flags & EXTENDED != 0 {
        notes.push("the file's extensions are not read".into());
    }
    let degree = header.degree.min(MAX_DEGREE);
    if header.degree > degree {
        notes.push(format!("harmonics of degree {} are left out", header.degree));
    }
    let gaussians = usable(path, decode(&header, &columns, degree), notes)?;
    notes.push(format!(
        "{} splats with harmonics of degree {degree}, SPZ {}: values are rounded",
        gaussians.len(),
        header.version
    ));
    Ok(gaussians)
}

/// The header at the cursor, whose announced size fits a file of `size` bytes.
fn header(cursor: &mut Cursor, size: usize) -> Result<Header> {
    if &cursor.array("the header")? != MAGIC {
        return Err(cursor.error("this is no SPZ file: it does not begin with NGSP"));
    }
    let version = cursor.u32("the version")?;
    let count = cursor.u32("the number of splats")? as usize;
    let [degree, fraction, flags, _] = cursor.array("the header")?;
    if !(2..=4).contains(&version) {
        return Err(cursor.error(format!("this is SPZ {version}, and versions 2 to 4 are read; convert it")));
    }
    if degree > 4 || fraction > 23 {
        return Err(cursor.error(format!(
            "the header gives harmonics of degree {degree} and {fraction} bits of fraction; export it again"
        )));
    }
    let header = Header { version, count, degree: degree.into(), fraction: fraction.into(), flags };
    match header.lengths().iter().sum::<usize>() {
        0 => Err(cursor.error("the file holds no splats; give one that was trained to the end")),
        length if length / SMALLEST > size => {
            let what =
                format!("the header announces {count} splats, more than the file can hold; copy or export it again");
            Err(cursor.error(what))
        }
        _ => Ok(header),
    }
}

/// Versions 2 and 3.
fn gzip(path: &Path, bytes: &[u8]) -> Result<(Header, Columns)> {
    let broken =
        |e: std::io::Error| Error::input(path, format!("it is no whole SPZ file ({e}); copy or export it again"));
    let mut decoder = GzDecoder::new(bytes);
    let mut start = [0; HEADER];
    decoder.read_exact(&mut start).map_err(broken)?;
    let header = header(&mut Cursor::new(path, &start, 0), bytes.len())?;
    if header.version > 3 {
        return Err(Error::input(
            path,
            format!("it is SPZ {} and compressed as older versions; export it again", header.version),
        ));
    }
    let mut columns = Columns::default();
    for (column, length) in columns.iter_mut().zip(header.lengths()) {
        // Not set aside at once: the header may announce more than there is.
        (&mut decoder).take(length as u64).read_to_end(column).map_err(broken)?;
        if column.len() < length {
            return Err(broken(std::io::ErrorKind::UnexpectedEof.into()));
        }
    }
    // The checksum is at the very end.
    if header.flags & EXTENDED == 0 {
        decoder.read(&mut [0]).map_err(broken)?;
    }
    Ok((header, columns))
}

/// Version 4.
fn streams(path: &Path, bytes: &[u8]) -> Result<(Header, Columns)> {
    let mut cursor = Cursor::new(path, bytes, 0);
    let header = header(&mut cursor, bytes.len())?;
    if header.version < 4 {
        return Err(cursor.error(format!("it is SPZ {} and not compressed; export it again", header.version)));
    }
    let count = bytes[HEADER - 1];
    let table = cursor.u32("the place of the table")? as usize;
    let lengths = header.lengths();
    let wanted = if header.degree == 0 { 5 } else { 6 };
    if usize::from(count) < wanted || table < LONG_HEADER {
        return Err(cursor.error(format!("it has {count} streams from byte {table}; export it again")));
    }
    let mut places = Cursor::new(path, bytes, table);
    let mut data = Cursor::new(path, bytes, table + 16 * usize::from(count));
    let mut columns = Columns::default();
    for (i, (column, length)) in columns.iter_mut().zip(lengths).take(wanted).enumerate() {
        let what = format!("stream {i}");
        let (packed, whole) = (places.u64(&what)?, places.u64(&what)?);
        if whole != length as u64 {
            return Err(places.error(format!("{what} has {whole} bytes and not {length}; export it again")));
        }
        let packed = data.take(usize::try_from(packed).unwrap_or(usize::MAX), &what)?;
        let broken = |e: String| data.error(format!("{what} is damaged ({e}); copy or export it again"));
        let decoder = ruzstd::decoding::StreamingDecoder::new(packed).map_err(|e| broken(e.to_string()))?;
        decoder.take(length as u64).read_to_end(column).map_err(|e| broken(e.to_string()))?;
        if column.len() < length {
            return Err(data.error(format!("{what} is cut short; copy or export the file again")));
        }
    }
    Ok((header, columns))
}

/// The values of all splats; columns have the lengths that the header says.
fn decode(
    header: &Header,
    [positions, opacities, colours, scales, rotations, harmonics]: &Columns,
    degree: u32,
) -> Gaussians {
    let fixed = |b: &[u8]| f64::from(i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8);
    let one = f64::from(1u32 << header.fraction);
    let centres = positions.chunks_exact(9).map(|p| DVec3::new(fixed(p), fixed(&p[3..]), fixed(&p[6..])) / one);
    let rotation = |bytes: &[u8]| match *bytes {
        [x, y, z] => {
            let [x, y, z] = [x, y, z].map(|v| f64::from(v) / 127.5 - 1.0);
            [(1.0 - x * x - y * y - z * z).max(0.0).sqrt(), x, y, z].map(|v| v as f32)
        }
        [a, b, c, d] => {
            let word = u32::from_le_bytes([a, b, c, d]);
            // Ten bits each, a sign and nine of size; the last component is lowest.
            let part = |shift: u32| {
                let size = f64::from(word >> shift & 0x1ff) / 511.0 * 0.5f64.sqrt();
                if word >> shift & 0x200 == 0 { size } else { -size }
            };
            let [x, y, z, w] = from_smallest_three((word >> 30) as usize, [part(20), part(10), part(0)]);
            [w, x, y, z]
        }
        _ => [1.0, 0.0, 0.0, 0.0],
    };
    let (each, stored) = (coefficients(degree), coefficients(header.degree));
    let mut values = Vec::with_capacity(3 * each * header.count);
    for (i, constant) in colours.chunks_exact(3).enumerate() {
        values.extend(constant.iter().map(|v| ((f64::from(*v) / 255.0 - 0.5) / COLOUR) as f32));
        let above = &harmonics[3 * (stored - 1) * i..][..3 * (each - 1)];
        values.extend(above.iter().map(|v| (f32::from(*v) - 128.0) / 128.0));
    }
    Gaussians {
        centres: centres.collect(),
        log_scales: scales.chunks_exact(3).map(|s| [s[0], s[1], s[2]].map(|v| f32::from(v) / 16.0 - 10.0)).collect(),
        rotations: rotations.chunks_exact(if header.version == 2 { 3 } else { 4 }).map(rotation).collect(),
        opacities: opacities.iter().map(|v| logit(*v) as f32).collect(),
        degree,
        harmonics: values,
        antialiased: header.flags & ANTIALIASED != 0,
    }
}

/// Bytes of a file of version 3, which all readers know, or 4.
pub fn write(gaussians: &Gaussians, version: u32) -> Vec<u8> {
    let reach = gaussians.centres.iter().map(|centre| centre.abs().max_element()).fold(0.0, f64::max);
    // As many bits as the farthest position leaves of 23; more than 20 are below single precision.
    let fraction = (0..=20u32).rev().find(|bits| reach * f64::from(1u32 << bits) < f64::from((1u32 << 23) - 1));
    let fraction = fraction.unwrap_or_default();
    let one = f64::from(1u32 << fraction);
    let limit = f64::from((1u32 << 23) - 1);
    let mut columns = Columns::default();
    let [positions, opacities, colours, scales, rotations, harmonics] = &mut columns;
    let each = gaussians.coefficients();
    // Neighbours are alike, which compresses better.
    for i in along_morton(&gaussians.centres) {
        for value in gaussians.centres[i].to_array() {
            positions.extend(&((one * value).round().clamp(-limit, limit) as i32).to_le_bytes()[..3]);
        }
        opacities.push(byte(255.0 * gaussians.opacity(i)));
        scales.extend(gaussians.log_scales[i].map(|scale| byte(16.0 * (f64::from(scale) + 10.0))));
        let [w, x, y, z] = gaussians.rotations[i];
        let (left_out, others) = smallest_three([x, y, z, w]);
        let word = others.iter().fold(left_out as u32, |word, part| {
            let size = (511.0 * part.abs() / 0.5f64.sqrt() + 0.5).min(511.0) as u32;
            word << 10 | u32::from(*part < 0.0) << 9 | size
        });
        rotations.extend(word.to_le_bytes());
        let own = &gaussians.harmonics[3 * each * i..3 * each * (i + 1)];
        colours.extend(own[..3].iter().map(|v| byte(255.0 * (COLOUR * f64::from(*v) + 0.5))));
        harmonics.extend(own[3..].iter().enumerate().map(|(k, v)| {
            let step = ROUNDED[usize::from(k >= 9)];
            let value = (128.0 * v).round() as i32 + 128;
            ((value + step / 2).div_euclid(step) * step).clamp(0, 255) as u8
        }));
    }
    let flags = if gaussians.antialiased { ANTIALIASED } else { 0 };
    let used = if gaussians.degree == 0 { 5 } else { 6 };
    let mut header = MAGIC.to_vec();
    header.extend([version, gaussians.len() as u32].map(u32::to_le_bytes).concat());
    header.extend([gaussians.degree as u8, fraction as u8, flags, if version > 3 { used as u8 } else { 0 }]);
    if version > 3 { as_streams(header, &columns[..used]) } else { as_gzip(&header, &columns) }
}

fn as_gzip(header: &[u8], columns: &Columns) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    // Writing to memory cannot fail.
    let written =
        std::iter::once(header).chain(columns.iter().map(Vec::as_slice)).try_for_each(|part| encoder.write_all(part));
    written.and_then(|()| encoder.finish()).unwrap_or_default()
}

fn as_streams(mut bytes: Vec<u8>, columns: &[Vec<u8>]) -> Vec<u8> {
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};
    let packed: Vec<Vec<u8>> =
        columns.iter().map(|column| compress_to_vec(column.as_slice(), CompressionLevel::Fastest)).collect();
    bytes.extend((LONG_HEADER as u32).to_le_bytes());
    bytes.resize(LONG_HEADER, 0);
    for (packed, column) in packed.iter().zip(columns) {
        bytes.extend([packed.len() as u64, column.len() as u64].map(u64::to_le_bytes).concat());
    }
    packed.iter().for_each(|packed| bytes.extend(packed));
    bytes
}
