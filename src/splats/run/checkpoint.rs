//! What a stopped run is resumed from: one file with all that the next iteration depends on.
//!
//! Layout, little-endian: `MAGIC`; bytes of the header as u64 and the header as JSON; a record of 20 bytes for each iteration
//! done; the planes of parameters and of Adam's two means without gaps, as f32; two f32 a Gaussian of statistics, where there are
//! any; of each photo 40 f32 of its exposure, and after these 20 f32 of its pose, where they are learnt; the CRC-32 of everything before.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::record::Evaluation;
use crate::files::io::folder::replace_file;
use crate::splats::config::{Strategy, TrainConfig};
use crate::splats::render::layout::planes;
use crate::splats::train::exposure::ExposureState;
use crate::splats::train::loss::Record;
use crate::splats::train::poses::PoseState;
use crate::splats::train::read_back::State;
use crate::{Error, Result};

/// First bytes of the file.
const MAGIC: &[u8] = b"camsplat checkpoint 3\n";
/// Keys that are named before others where several differ.
const FIRST: [&str; 4] = ["strategy", "shrink", "photos", "tests"];
/// Most bytes of a header: it holds an entry per evaluation and nothing longer.
const MAX_HEADER: usize = 64 << 20;

/// The inputs of a run beside its configuration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Input {
    /// Photos that are trained on.
    pub photos: usize,
    /// CRC-32 of their names, sizes and cameras.
    pub cameras: u32,
    /// CRC-32 of their pixels, with masks and alpha.
    pub pixels: u32,
    /// Each pixel is a square of so many stored pixels.
    pub shrink: u32,
    /// Gaussians at the start.
    pub start: usize,
    /// Photos to test with.
    #[serde(default)]
    pub tests: usize,
    /// CRC-32 of their names, sizes and cameras, and of their pixels.
    #[serde(default)]
    pub test_photos: [u32; 2],
}

/// The head of a checkpoint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// How the run trains.
    pub config: TrainConfig,
    /// The run's other inputs.
    pub input: Input,
    /// Iterations done.
    pub done: u32,
    /// Gaussians that there are.
    pub population: u32,
    /// Evaluations so far.
    pub evaluations: Vec<Evaluation>,
}

/// A checkpoint.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Configuration and counters.
    pub header: Header,
    /// Losses of the iterations.
    pub history: Vec<Record>,
    /// Parameters and moments.
    pub state: State,
}

/// Writes a checkpoint in place of the one before, which stays until the new one is whole.
///
/// # Errors
/// When the system refuses, a full disk among others.
pub fn write(path: &Path, checkpoint: &Checkpoint) -> Result<()> {
    let Checkpoint { header, history, state } = checkpoint;
    let header = serde_json::to_vec(header).map_err(|e| Error::input(path, format!("it cannot be written: {e}")))?;
    replace_file(path, |file| {
        let mut sum = crc32fast::Hasher::new();
        let mut put = |bytes: &[u8]| {
            sum.update(bytes);
            file.write_all(bytes)
        };
        put(MAGIC)?;
        put(&(header.len() as u64).to_le_bytes())?;
        put(&header)?;
        for Record { l1, ssim, squared, instances, splats } in history {
            put(&[l1.to_le_bytes(), ssim.to_le_bytes(), squared.to_le_bytes()].concat())?;
            put(&[instances.to_le_bytes(), splats.to_le_bytes()].concat())?;
        }
        for plane in &state.planes {
            for part in plane.chunks(1 << 16) {
                let bytes: Vec<u8> = part.iter().flat_map(|value| value.to_le_bytes()).collect();
                put(&bytes)?;
            }
        }
        for pair in &state.statistics {
            put(&[pair[0].to_le_bytes(), pair[1].to_le_bytes()].concat())?;
        }
        let (exposures, poses) = (bytemuck::cast_slice(&state.exposures), bytemuck::cast_slice(&state.poses));
        for number in [exposures, poses].concat() {
            put(&f32::to_le_bytes(number))?;
        }
        let sum = sum.finalize();
        file.write_all(&sum.to_le_bytes())
    })
}

/// Reads a checkpoint.
///
/// # Errors
/// When it is not there, not one, cut short or damaged.
pub fn read(path: &Path) -> Result<Checkpoint> {
    let bytes = std::fs::read(path).map_err(|source| Error::io(path, source))?;
    let damaged = |what: &str| Error::input(path, format!("the checkpoint is damaged ({what}); train anew (`force`)"));
    if !bytes.starts_with(MAGIC) {
        return Err(Error::input(
            path,
            "this is no checkpoint of camsplat that this version reads; train anew (`force`)",
        ));
    }
    let (body, sum) = bytes.split_at(bytes.len() - 4);
    if body.len() < MAGIC.len() + 8 || crc32fast::hash(body).to_le_bytes() != sum {
        return Err(damaged("its check sum is wrong"));
    }
    let (length, rest) = body[MAGIC.len()..].split_at(8);
    let length = length.iter().rev().fold(0u64, |value, byte| value << 8 | u64::from(*byte)) as usize;
    if length > MAX_HEADER || length > rest.len() {
        return Err(damaged("its header is too long"));
    }
    let (header, rest) = rest.split_at(length);
    let header: Header = serde_json::from_slice(header).map_err(|e| damaged(&format!("its header: {e}")))?;
    header.config.validate()?;
    let values = planes(header.config.degree) as u64 * u64::from(header.population);
    let counted = if header.config.strategy == Strategy::Adc { header.population as usize } else { 0 };
    let photos = |learnt: bool| if learnt { header.input.photos } else { 0 };
    let (exposed, posed) = (photos(header.config.exposure), photos(header.config.refine_poses));
    let of_exposures = (size_of::<ExposureState>() as u64).saturating_mul(exposed as u64);
    let of_poses = (size_of::<PoseState>() as u64).saturating_mul(posed as u64);
    let others = 20 * u64::from(header.done) + 12 * values + 8 * counted as u64;
    if rest.len() as u64 != others.saturating_add(of_exposures).saturating_add(of_poses)
        || header.population > header.config.max_splats
    {
        return Err(damaged("it is not as long as its header says"));
    }
    let (history, rest) = rest.split_at(20 * header.done as usize);
    let word = |bytes: &[u8], i: usize| [0, 1, 2, 3].map(|k| bytes[4 * i + k]);
    let float = |bytes: &[u8], i: usize| f32::from_le_bytes(word(bytes, i));
    let history = history
        .chunks_exact(20)
        .map(|record| Record {
            l1: float(record, 0),
            ssim: float(record, 1),
            squared: float(record, 2),
            instances: u32::from_le_bytes(word(record, 3)),
            splats: u32::from_le_bytes(word(record, 4)),
        })
        .collect();
    let part = 4 * values as usize;
    let plane = |i: usize| (0..values as usize).map(|k| float(&rest[i * part..], k)).collect();
    let statistics = (0..counted).map(|k| [0, 1].map(|c| float(&rest[3 * part..], 2 * k + c))).collect();
    let planes = [plane(0), plane(1), plane(2)];
    let behind = &rest[3 * part + 8 * counted..];
    let numbers: Vec<f32> = (0..behind.len() / 4).map(|k| float(behind, k)).collect();
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err(damaged("an exposure or a pose is no number"));
    }
    // As long as the length that was checked.
    let (exposures, poses) = numbers.split_at(of_exposures as usize / 4);
    let (exposures, poses) = (bytemuck::cast_slice(exposures).to_vec(), bytemuck::cast_slice(poses).to_vec());
    let state = State { done: header.done, population: header.population, planes, statistics, exposures, poses };
    Ok(Checkpoint { header, history, state })
}

/// Checks a run against the checkpoint that it is to be resumed from.
///
/// # Errors
/// In a line that names a key that differs, and its two values.
pub fn check(path: &Path, header: &Header, config: &TrainConfig, input: &Input) -> Result<()> {
    let of = |config: &TrainConfig, input: &Input| -> Vec<(String, Value)> {
        let objects = [serde_json::to_value(config), serde_json::to_value(input)];
        let entries = objects.into_iter().flatten().filter_map(|value| match value {
            Value::Object(map) => Some(map),
            _ => None,
        });
        entries.flatten().collect()
    };
    let (then, now) = (of(&header.config, &header.input), of(config, input));
    let differs = then.into_iter().zip(now).filter(|(then, now)| then != now);
    // What others follow from comes first, and what a user can count.
    let order = |key: &str| FIRST.iter().position(|first| *first == key).unwrap_or(FIRST.len());
    let Some(((key, then), (_, now))) = differs.min_by_key(|(then, _)| order(&then.0)) else { return Ok(()) };
    let [then, now] = [then, now].map(|value| value.as_str().map_or(value.to_string(), str::to_owned));
    let what = if SETTINGS.contains(&key.as_str()) {
        format!("it was made with `{key}` {then}, not {now}; resume with the same, or train anew (`force`)")
    } else {
        format!("it was made of another capture ({key}: {then}, not {now}); train anew (`force`)")
    };
    Err(Error::input(path, what))
}

/// Keys that users set; the others follow from these or from the capture.
const SETTINGS: [&str; 15] = [
    "iterations",
    "max_splats",
    "strategy",
    "degree",
    "background",
    "antialiased",
    "suppress_floaters",
    "exposure",
    "refine_poses",
    "masks",
    "init_opacity",
    "init_scale",
    "fast",
    "seed",
    "shrink",
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splats::config::Start;
    use crate::splats::run::record::Quality;

    fn checkpoint() -> Checkpoint {
        let config = TrainConfig { degree: 0, exposure: true, refine_poses: true, ..TrainConfig::new(100, 8) };
        let values = planes(0) * 3;
        let quality = Quality { psnr: f64::INFINITY, ssim: 1.0, ..Quality::default() };
        let plane = |k: usize| (0..values).map(|i| (i * (k + 1)) as f32 * 0.1).collect();
        Checkpoint {
            header: Header {
                config,
                input: Input { photos: 5, cameras: 7, pixels: 9, shrink: 1, start: 3, tests: 2, test_photos: [4, 6] },
                done: 2,
                population: 3,
                // Black photos of nothing are the same as black pictures.
                evaluations: vec![Evaluation { iteration: 1, views: 2, quality }],
            },
            history: (0..2).map(|i| Record { l1: 0.5, ssim: 0.25, squared: 0.1, instances: i, splats: 3 }).collect(),
            state: State {
                done: 2,
                population: 3,
                planes: [plane(0), plane(1), plane(2)],
                statistics: Vec::new(),
                exposures: vec![ExposureState { value: [0.5; 12], steps: 3.0, ..ExposureState::default() }; 5],
                poses: vec![PoseState { value: [0.1; 6], steps: 3.0, ..PoseState::default() }; 5],
            },
        }
    }

    /// If this failed, a resumed run would differ from one that was never stopped.
    #[test]
    fn a_checkpoint_comes_back_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        write(&path, &checkpoint()).unwrap();
        assert_eq!(read(&path).unwrap(), checkpoint());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "something else was left behind");
    }

    /// If this failed, a damaged checkpoint would train on as rubbish, or a short one would panic.
    #[test]
    fn no_prefix_and_no_changed_byte_is_accepted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        write(&path, &checkpoint()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for i in 0..whole.len() {
            std::fs::write(&path, &whole[..i]).unwrap();
            assert!(read(&path).is_err(), "{i} of {} bytes were accepted", whole.len());
            let mut changed = whole.clone();
            changed[i] ^= 0x10;
            std::fs::write(&path, &changed).unwrap();
            assert!(read(&path).is_err(), "byte {i} may be anything");
        }
    }

    /// A full disk: the existing file must stay. A folder in the way of the hidden file is refused as a full disk is.
    #[test]
    fn a_failed_write_keeps_the_older_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint");
        write(&path, &checkpoint()).unwrap();
        let failed = replace_file(&path, |file| {
            file.write_all(&[0; 4096])?;
            Err(std::io::Error::from(std::io::ErrorKind::StorageFull))
        });
        assert!(failed.unwrap_err().to_string().contains("checkpoint"));
        assert_eq!(read(&path).unwrap(), checkpoint());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "the unfinished file was left behind");
    }

    /// If this failed, a user would not learn which option to set right.
    #[test]
    fn the_key_that_differs_is_named() {
        let Header { config, input, .. } = checkpoint().header;
        let refusal = |config: &TrainConfig, input: &Input| {
            check(Path::new("c"), &checkpoint().header, config, input).unwrap_err().to_string()
        };
        check(Path::new("c"), &checkpoint().header, &config, &input).unwrap();
        let other = TrainConfig { degree: 2, ..config.clone() };
        assert!(refusal(&other, &input).contains("`degree` 0, not 2"), "{}", refusal(&other, &input));
        let other = config.clone().with_strategy(Strategy::Adc, Start::Points);
        assert!(refusal(&other, &input).contains("`strategy` mcmc, not adc"), "{}", refusal(&other, &input));
        let other = Input { cameras: 8, ..input };
        assert!(refusal(&config, &other).contains("another capture (cameras: 7, not 8)"));
        let other = Input { tests: 3, test_photos: [1, 1], ..input };
        assert!(refusal(&config, &other).contains("another capture (tests: 2, not 3)"));
    }
}
