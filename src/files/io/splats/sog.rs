//! SOG, the splats of PlayCanvas (developer.playcanvas.com, "The SOG format", version 2): pictures in lossless WebP, a pixel for a splat,
//! and `meta.json`, together in a zip file, or beside each other. Positions are 16 bits of a signed logarithm, scales and colours numbers
//! of a codebook, rotations three components in 8 bits, higher harmonics a number in a palette.

use std::io::{Cursor, Read, Write};
use std::path::Path;

use glam::DVec3;
use image::codecs::webp::WebPEncoder;
use image::{ExtendedColorType, ImageFormat, ImageReader, Limits};
use serde::{Deserialize, Serialize};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

use super::codebook::{codebook, nearest, palette};
use super::order::along_morton;
use super::quantised::{WIDEST, byte, from_smallest_three, logit, smallest_three};
use super::usable::usable;
use crate::error::{Error, Result};
use crate::files::io::photos::files::within;
use crate::scene::gaussians::{Gaussians, coefficients};

/// The first bytes of a zip file.
const ZIP: &[u8; 4] = b"PK\x03\x04";
/// Most vectors in a palette, and how many there are in a row of its picture.
const PALETTE: usize = 1 << 16;
const IN_ROW: usize = 64;
/// Largest side of a WebP picture.
const SIDE: u32 = 16_383;
/// Alpha that says which component of a rotation was left out is this and the three after.
const ROTATIONS: u8 = 252;
/// What a file may hold of one part: `meta.json` has a few codebooks, a picture no more than its pixels.
const LARGEST: u64 = 1 << 30;

/// `meta.json`.
#[derive(Serialize, Deserialize)]
struct Meta {
    version: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    asset: Option<Asset>,
    count: usize,
    /// How it was trained: `antialiased`, or nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    model: Option<String>,
    means: Means,
    scales: Coded,
    quats: Files,
    sh0: Coded,
    #[serde(rename = "shN", default, skip_serializing_if = "Option::is_none")]
    rest: Option<Rest>,
}

#[derive(Serialize, Deserialize)]
struct Asset {
    #[serde(default)]
    generator: String,
}

#[derive(Serialize, Deserialize)]
struct Means {
    mins: [f64; 3],
    maxs: [f64; 3],
    files: [String; 2],
}

#[derive(Serialize, Deserialize)]
struct Coded {
    codebook: Vec<f32>,
    files: [String; 1],
}

#[derive(Serialize, Deserialize)]
struct Files {
    files: [String; 1],
}

#[derive(Serialize, Deserialize)]
struct Rest {
    count: usize,
    /// Degree of the harmonics.
    bands: u32,
    codebook: Vec<f32>,
    files: [String; 2],
}

/// Whether a file is one of these.
pub(super) fn is_sog(bytes: &[u8]) -> bool {
    bytes.starts_with(ZIP)
}

/// A picture of four bytes for each pixel.
struct Picture {
    width: usize,
    bytes: Vec<u8>,
}

impl Picture {
    fn pixel(&self, i: usize) -> [u8; 4] {
        let at = 4 * i;
        self.bytes.get(at..at + 4).map_or([0; 4], |p| [p[0], p[1], p[2], p[3]])
    }
}

/// Reads the bytes of a file.
///
/// # Errors
/// Where it is damaged, of another version or lacks a part, or holds no splats that can be used.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Gaussians> {
    let refuse = |what: String| again(path, what);
    let mut archive =
        ZipArchive::new(Cursor::new(bytes)).map_err(|e| refuse(format!("it is no whole zip file ({e})")))?;
    let part = |name: &str| -> Result<Vec<u8>> {
        let mut found = Vec::new();
        let file = archive.by_name(name).map_err(|e| refuse(format!("its part {name:?} cannot be read ({e})")))?;
        file.take(LARGEST)
            .read_to_end(&mut found)
            .map_err(|e| refuse(format!("its part {name:?} is damaged ({e})")))?;
        Ok(found)
    };
    assembled(path, part, notes)
}

/// Reads a `meta.json` whose pictures lie beside it.
///
/// # Errors
/// As [`parse`].
pub fn read_meta(path: &Path, notes: &mut Vec<String>) -> Result<Gaussians> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let part = |name: &str| {
        let file =
            within(folder, name).ok_or_else(|| again(path, format!("its part {name:?} lies outside of its folder")))?;
        std::fs::read(&file).map_err(|source| Error::io(file, source))
    };
    assembled(path, part, notes)
}

fn again(path: &Path, what: String) -> Error {
    Error::input(path, format!("{what}; export it again"))
}

/// The splats of which `part` gives the parts by name.
fn assembled(path: &Path, mut part: impl FnMut(&str) -> Result<Vec<u8>>, notes: &mut Vec<String>) -> Result<Gaussians> {
    let refuse = |what: String| again(path, what);
    let text = part("meta.json")?;
    /// What all versions have.
    #[derive(Deserialize)]
    struct Version {
        version: Option<u32>,
    }
    let Version { version } = crate::files::io::json(path, &text)?;
    if version != Some(2) {
        let version = version.map_or("1".into(), |version| version.to_string());
        return Err(refuse(format!("it is SOG of version {version}, and version 2 is read")));
    }
    let meta: Meta = crate::files::io::json(path, &text)?;
    let mut picture = |name: &str, pixels: usize| -> Result<Picture> {
        let bytes = part(name)?;
        let wrong = |what: String| refuse(format!("its picture {name:?} {what}"));
        let mut reader = ImageReader::with_format(Cursor::new(&bytes), ImageFormat::WebP);
        let mut limits = Limits::default();
        limits.max_alloc = Some(LARGEST);
        reader.limits(limits);
        let decoded = reader.decode().map_err(|e| wrong(format!("cannot be decoded ({e})")))?.into_rgba8();
        if decoded.pixels().len() < pixels {
            return Err(wrong(format!("has {} pixels and not {pixels}", decoded.pixels().len())));
        }
        Ok(Picture { width: decoded.width() as usize, bytes: decoded.into_raw() })
    };
    let count = meta.count;
    let means = [picture(&meta.means.files[0], count)?, picture(&meta.means.files[1], count)?];
    let (quats, scales, sh0) = (
        picture(&meta.quats.files[0], count)?,
        picture(&meta.scales.files[0], count)?,
        picture(&meta.sh0.files[0], count)?,
    );
    let rest = meta.rest.as_ref().filter(|rest| rest.bands > 0);
    let degree = rest.map_or(0, |rest| rest.bands);
    if degree > 3 {
        return Err(refuse(format!("it has harmonics of degree {degree}, and there are 3")));
    }
    let each = coefficients(degree);
    let rest = match rest {
        Some(rest) => {
            let rows = rest.count.div_ceil(IN_ROW);
            let centres = picture(&rest.files[0], IN_ROW.saturating_mul(each - 1).saturating_mul(rows))?;
            if centres.width != IN_ROW * (each - 1) {
                return Err(refuse(format!(
                    "its palette is {} pixels wide and not {}",
                    centres.width,
                    IN_ROW * (each - 1)
                )));
            }
            Some((rest, centres, picture(&rest.files[1], count)?))
        }
        None => None,
    };
    let code = |book: &[f32], entry: u8| book.get(usize::from(entry)).copied().unwrap_or(f32::NAN);
    let mut gaussians =
        Gaussians { degree, antialiased: meta.model.as_deref() == Some("antialiased"), ..Gaussians::default() };
    for i in 0..count {
        let (low, high) = (means[0].pixel(i), means[1].pixel(i));
        let axis = |k: usize| {
            let part = f64::from(u16::from_le_bytes([low[k], high[k]])) / 65_535.0;
            let log = meta.means.mins[k] + part * (meta.means.maxs[k] - meta.means.mins[k]);
            log.signum() * log.abs().exp_m1()
        };
        gaussians.centres.push(DVec3::new(axis(0), axis(1), axis(2)));
        let scale = scales.pixel(i);
        gaussians.log_scales.push([0, 1, 2].map(|k| code(&meta.scales.codebook, scale[k])));
        let [a, b, c, which] = quats.pixel(i);
        let parts = [a, b, c].map(|v| (f64::from(v) / 127.5 - 1.0) * 0.5f64.sqrt());
        gaussians.rotations.push(match which.checked_sub(ROTATIONS) {
            Some(left_out) => from_smallest_three(left_out.into(), parts),
            None => [0.0; 4],
        });
        let colour = sh0.pixel(i);
        gaussians.opacities.push(logit(colour[3]) as f32);
        gaussians.harmonics.extend([0, 1, 2].map(|k| code(&meta.sh0.codebook, colour[k])));
        if let Some((rest, centres, labels)) = &rest {
            let [a, b, ..] = labels.pixel(i);
            let label = usize::from(u16::from_le_bytes([a, b]));
            // Rows of the palette's picture hold whole vectors.
            let entries = (0..each - 1).map(|k| centres.pixel(label * (each - 1) + k));
            gaussians
                .harmonics
                .extend(entries.flat_map(|p| [p[0], p[1], p[2]].map(|entry| code(&rest.codebook, entry))));
        }
    }
    if count == 0 {
        return Err(refuse("the file holds no splats".into()));
    }
    let gaussians = usable(path, gaussians, notes)?;
    notes.push(format!("{} splats with harmonics of degree {degree}, SOG: values are rounded", gaussians.len()));
    Ok(gaussians)
}

/// Bytes of a file.
///
/// # Errors
/// Where there are more splats than a picture has pixels.
pub fn write(gaussians: &Gaussians) -> Result<Vec<u8>> {
    let count = gaussians.len();
    let width = ((count as f64).sqrt() / 4.0).ceil() as u32 * 4;
    let height = (count as u32).div_ceil(width.max(1)).div_ceil(4) * 4;
    if width > SIDE || height > SIDE {
        return Err(Error::request(format!("{count} splats are more than a SOG file holds; write another format")));
    }
    let order = along_morton(&gaussians.centres);
    let log = |v: f64| v.signum() * v.abs().ln_1p();
    let logs: Vec<DVec3> = gaussians.centres.iter().map(|c| DVec3::new(log(c.x), log(c.y), log(c.z))).collect();
    let (low, high) = logs.iter().fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)));
    let span = DVec3::select((high - low).cmpgt(DVec3::ZERO), high - low, DVec3::ONE);
    let fixed = |i: usize| (65_535.0 * (logs[i] - low) / span).round().to_array().map(|v| v as u16);
    let scale = |i: usize| gaussians.log_scales[i].map(|scale| scale.clamp(-WIDEST, WIDEST));
    let scales = codebook((0..count).flat_map(scale));
    let each = 3 * gaussians.coefficients();
    let constant = |i: usize| &gaussians.harmonics[each * i..][..3];
    let colours = codebook((0..count).flat_map(|i| constant(i).iter().copied()));
    let quaternion = |i: usize| {
        let (left_out, others) = smallest_three(gaussians.rotations[i]);
        let [a, b, c] = others.map(|v| byte(127.5 * (v / 0.5f64.sqrt() + 1.0)));
        [a, b, c, ROTATIONS + left_out as u8]
    };
    let colour = |i: usize| {
        let [r, g, b] = [0, 1, 2].map(|k| nearest(&colours, constant(i)[k]));
        [r, g, b, byte(255.0 * gaussians.opacity(i))]
    };
    let picture = |pixel: &dyn Fn(usize) -> [u8; 4]| webp(order.iter().map(|i| pixel(*i)), width, height);
    let opaque = |[a, b, c]: [u8; 3]| [a, b, c, 255];
    let mut files = vec![
        ("means_l.webp", picture(&|i| opaque(fixed(i).map(|v| v as u8)))?),
        ("means_u.webp", picture(&|i| opaque(fixed(i).map(|v| (v >> 8) as u8)))?),
        ("quats.webp", picture(&quaternion)?),
        ("scales.webp", picture(&|i| opaque(scale(i).map(|scale| nearest(&scales, scale))))?),
        ("sh0.webp", picture(&colour)?),
    ];
    let name = |name: &str| [name.to_owned()];
    let mut meta = Meta {
        version: 2,
        asset: Some(Asset { generator: "camsplat".into() }),
        count,
        model: gaussians.antialiased.then(|| "antialiased".into()),
        means: Means {
            mins: low.into(),
            maxs: high.into(),
            files: ["means_l.webp", "means_u.webp"].map(str::to_owned),
        },
        scales: Coded { codebook: scales.clone(), files: name("scales.webp") },
        quats: Files { files: name("quats.webp") },
        sh0: Coded { codebook: colours.clone(), files: name("sh0.webp") },
        rest: None,
    };
    if gaussians.degree > 0 {
        let above = each / 3 - 1;
        let vectors: Vec<f32> =
            (0..count).flat_map(|i| gaussians.harmonics[each * i + 3..each * (i + 1)].iter().copied()).collect();
        let own = palette(&vectors, 3 * above, PALETTE);
        let book = codebook(own.centres.iter().copied());
        let entries = own.centres.chunks_exact(3).map(|c| opaque([0, 1, 2].map(|k| nearest(&book, c[k]))));
        let held = own.centres.len() / (3 * above);
        files.push(("shN_centroids.webp", webp(entries, (IN_ROW * above) as u32, held.div_ceil(IN_ROW) as u32)?));
        let label = |i: usize| (own.labels[i] as u16).to_le_bytes();
        files.push(("shN_labels.webp", picture(&|i| opaque([label(i)[0], label(i)[1], 0]))?));
        let files = ["shN_centroids.webp", "shN_labels.webp"].map(str::to_owned);
        meta.rest = Some(Rest { count: held, bands: gaussians.degree, codebook: book, files });
    }
    let failed = |e: String| Error::request(format!("the SOG file cannot be made: {e}"));
    let text = serde_json::to_vec(&meta).map_err(|e| failed(e.to_string()))?;
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    // WebP is compressed already, and viewers take parts out of the file as they are.
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    for (name, bytes) in files.iter().map(|(name, bytes)| (*name, bytes)).chain([("meta.json", &text)]) {
        archive.start_file(name, options).map_err(|e| failed(e.to_string()))?;
        archive.write_all(bytes).map_err(|e| failed(e.to_string()))?;
    }
    Ok(archive.finish().map_err(|e| failed(e.to_string()))?.into_inner())
}

/// A lossless picture of pixels, black and clear where there are fewer than it has.
fn webp(pixels: impl Iterator<Item = [u8; 4]>, width: u32, height: u32) -> Result<Vec<u8>> {
    let mut raw: Vec<u8> = pixels.flatten().collect();
    raw.resize(4 * width as usize * height as usize, 0);
    let mut bytes = Vec::new();
    WebPEncoder::new_lossless(&mut bytes)
        .encode(&raw, width, height, ExtendedColorType::Rgba8)
        .map_err(|e| Error::request(format!("a picture of the SOG file cannot be made: {e}")))?;
    Ok(bytes)
}
