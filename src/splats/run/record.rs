//! What a training run leaves behind: the contents of `train.json`, from which the report is drawn as well.

use glam::DMat3;
use serde::{Deserialize, Deserializer, Serialize};

use crate::scene::camera::{Camera, Pose};
use crate::splats::config::{Strategy, TrainConfig};
use crate::splats::exposure::Exposure;

/// How far a run has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// It is running, or was killed.
    Running,
    /// The user stopped it; it can be resumed.
    Interrupted,
    /// The device failed or ran out of memory; it can be resumed from its last checkpoint, if it has one.
    Failed,
    /// All iterations ran.
    Complete,
}

/// The photos of a run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhotosRecord {
    /// Path of the capture as the user gave it.
    pub capture: String,
    /// Photos that are trained on.
    pub train: usize,
    /// Photos that are tested with.
    pub test: usize,
    /// Largest width and height in pixels, after shrinking.
    pub largest: [u32; 2],
    /// Each pixel is a square of so many stored pixels.
    pub shrink: u32,
    /// Points of the capture; none where the start was random.
    pub points: usize,
    /// Extent of the training cameras in the capture's units.
    pub extent: f64,
}

/// Means over a stretch of iterations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Last iteration of the stretch, counted from one.
    pub iteration: u32,
    /// Loss, without the regularisers of parameters.
    pub loss: f64,
    /// PSNR of the training pictures in decibels, without rounding, in the mean of those that were not rendered exactly; infinite,
    /// `null` in JSON, where all were.
    #[serde(deserialize_with = "or_infinite")]
    pub psnr: f64,
    /// Splats at its end.
    pub splats: u32,
    /// Instances (pairs of a splat and a tile) of a picture.
    pub instances: f64,
}

/// Image metrics, in the mean over test views or of one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// PSNR in decibels, of 8-bit values; infinite, `null` in JSON, where the pictures are the same.
    #[serde(deserialize_with = "or_infinite")]
    pub psnr: f64,
    /// SSIM, of 8-bit values.
    pub ssim: f64,
    /// LPIPS with AlexNet; absent where it was not measured.
    pub lpips: Option<f64>,
    /// LPIPS with VGG16, which `camsplat evaluate --lpips-vgg` measures; absent elsewhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lpips_vgg: Option<f64>,
}

/// A number, or infinity for `null`.
fn or_infinite<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

/// Metrics of the test views at an iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Iterations done.
    pub iteration: u32,
    /// Test views that were looked at.
    pub views: usize,
    /// Means over them.
    pub quality: Quality,
}

/// A test view at the end.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TestView {
    /// Name of the photo.
    pub name: String,
    /// Its metrics.
    pub quality: Quality,
}

/// What was learnt of a photo's exposure: a colour c of the model is `matrix c + offset` in the photo, in sRGB from 0 to 1.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhotoExposure {
    /// Name of the photo.
    pub name: String,
    /// By rows.
    pub matrix: [[f64; 3]; 3],
    /// What is added.
    pub offset: [f64; 3],
}

impl PhotoExposure {
    /// Of a photo of that name.
    pub fn new(name: String, exposure: &Exposure) -> Self {
        let rows = exposure.matrix.transpose().to_cols_array_2d();
        Self { name, matrix: rows, offset: exposure.offset.to_array() }
    }

    /// How much brighter than the model a grey of one half is in the photo: red, green, blue.
    pub fn gains(&self) -> [f64; 3] {
        [0, 1, 2].map(|c| self.matrix[c].iter().sum::<f64>() + 2.0 * self.offset[c])
    }
}

/// What the pose of a photo was corrected to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PhotoPose {
    /// Name of the photo.
    pub name: String,
    /// Degrees by which the camera was turned.
    pub turned_deg: f64,
    /// Distance by which it was moved, in the capture's units.
    pub moved: f64,
    /// World-from-camera, by rows, in OpenCV axes and the capture's units.
    pub matrix: [[f64; 4]; 3],
}

impl PhotoPose {
    /// Of a camera as it was given and as it is now.
    pub fn new(given: &Camera, refined: &Camera) -> Self {
        let Pose { position, rotation } = refined.pose;
        let axes = DMat3::from_quat(rotation).transpose();
        let row = |k: usize| {
            let [x, y, z] = axes.col(k).to_array();
            [x, y, z, position[k]]
        };
        Self {
            name: given.name.clone(),
            turned_deg: given.pose.rotation.angle_between(rotation).to_degrees(),
            moved: given.pose.position.distance(position),
            matrix: [0, 1, 2].map(row),
        }
    }
}

/// GPU time of a stage, sampled from blocks of iterations throughout the run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StageTime {
    /// The stage's name.
    pub name: String,
    /// Milliseconds in an iteration, all its dispatches together.
    pub ms: f64,
}

/// Device memory.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MemoryRecord {
    /// Bytes of each buffer that a dry run announces.
    pub buffers: Vec<(String, u64)>,
    /// Their sum.
    pub announced: u64,
    /// Most bytes of buffers that were allocated at once.
    pub peak: u64,
}

/// A run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainRecord {
    /// Version of camsplat.
    pub version: String,
    /// How far it has come.
    pub status: Status,
    /// Name of the device.
    pub device: String,
    /// The photos that were trained and tested on.
    pub photos: PhotosRecord,
    /// How the run trained.
    pub config: TrainConfig,
    /// Iterations done.
    pub iterations: u32,
    /// Splats now.
    pub splats: u32,
    /// Wall-clock seconds of training in this process.
    pub seconds: f64,
    /// Iterations that these seconds were spent on.
    pub seconds_for: u32,
    /// Seconds for which the device worked on them: well below `seconds` where the host keeps it waiting. None where the device
    /// has no timestamps or every stage is waited for.
    #[serde(default)]
    pub gpu_seconds: Option<f64>,
    /// The training of the run; a few hundred points at most.
    pub curve: Vec<CurvePoint>,
    /// Test metrics on the way and at the end.
    pub evaluations: Vec<Evaluation>,
    /// Test views, worst PSNR first; empty before the first evaluation.
    pub test_views: Vec<TestView>,
    /// Of the photos that were trained on, where they were learnt.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub exposures: Vec<PhotoExposure>,
    /// Of the same photos, where their poses were corrected.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub poses: Vec<PhotoPose>,
    /// Time per stage, longest first.
    pub stages: Vec<StageTime>,
    /// Device memory.
    pub memory: MemoryRecord,
}

/// Iterations below which the training curve does not show whether training diverged.
const MIN_JUDGED: u32 = 1000;

/// Least drop in decibels that lasts to the end, by which training counts as diverged.
pub(crate) const DIVERGED_DB: f64 = 1.0;

/// Least drop in decibels between fifteenths of a training by MCMC, by which it counts as diverged though it recovers: 6 and 12 have been
/// seen, and in some 280 other trainings 1.2 at most (docs/results/training.md).
pub(crate) const PASSING_DB: f64 = 3.0;

/// Rise in decibels in the last fifth of a training from which it counts as too short.
const RISING_DB: f64 = 0.3;

/// Drop in decibels of the test views' PSNR from which a training counts as too long.
const OVERFITTED_DB: f64 = 0.3;

impl TrainRecord {
    /// Mean PSNR of the training pictures in decibels before and after a fall: with MCMC in two fifteenths of the run, where the later is
    /// worse by more than [`PASSING_DB`], though the model may recover when relocations end; else in the best fifth and in the last,
    /// where the last is worse by more than [`DIVERGED_DB`]. Relocation is the likely cause (docs/reference/training.md, What can go
    /// wrong). None of runs that are not complete or have fewer than 1000 iterations.
    pub fn diverged(&self) -> Option<[f64; 2]> {
        let judged = self.status == Status::Complete && self.config.iterations >= MIN_JUDGED;
        judged.then(|| fall(&self.curve, self.config.strategy)).flatten()
    }

    /// What to do where a complete training was too short to show what its photos can: its pictures still improved when it ended, and
    /// those of the test views were not the worse for it.
    pub fn short_line(&self) -> Option<String> {
        let judged = self.status == Status::Complete && self.overfitted().is_none() && self.diverged().is_none();
        let rise = rising(&self.curve).filter(|_| judged)?;
        Some(format!(
            "training was too short: PSNR on the training photos still rose by {rise:.1} dB in its last fifth; train for more iterations"
        ))
    }

    /// The best evaluation of a complete training and its last, where the last has a test PSNR that is lower by more than
    /// [`OVERFITTED_DB`]: the model comes to fit its photos at the cost of all other views. None of trainings that diverged.
    pub fn overfitted(&self) -> Option<[Evaluation; 2]> {
        let judged = self.status == Status::Complete && self.diverged().is_none();
        // In the last evaluation poses of test views are corrected too: it compares with none before it.
        let alike = self.evaluations.len().saturating_sub(usize::from(self.config.refine_poses));
        judged.then(|| worsened(&self.evaluations[..alike])).flatten()
    }

    /// [`Self::overfitted`] in a sentence.
    pub fn overfitted_line(&self) -> Option<String> {
        self.overfitted().map(|[best, last]| {
            format!(
                "training was too long for so few photos: PSNR on the test views fell from {:.1} dB after {} iterations to {:.1}; train for \
                 {} iterations, or take more photos",
                best.quality.psnr, best.iteration, last.quality.psnr, best.iteration
            )
        })
    }

    /// How far poses were corrected, where they were: in the median and at most.
    pub fn poses_line(&self) -> Option<String> {
        let of = |value: fn(&PhotoPose) -> f64| {
            let mut values: Vec<f64> = self.poses.iter().map(value).collect();
            values.sort_by(f64::total_cmp);
            Some([*values.get(values.len() / 2)?, *values.last()?])
        };
        let ([turned, most_turned], [moved, most_moved]) = (of(|pose| pose.turned_deg)?, of(|pose| pose.moved)?);
        let part = |moved: f64| 100.0 * moved / self.photos.extent;
        Some(format!(
            "turned by {turned:.2} degrees and moved by {:.2}% of the cameras' extent in the median, by {most_turned:.2} and {:.2}% at most",
            part(moved),
            part(most_moved)
        ))
    }

    /// [`Self::diverged`] in a sentence.
    pub fn diverged_line(&self) -> Option<String> {
        self.diverged().map(|[best, after]| {
            let end = parts(&self.curve, 15).last().copied().filter(|end| end - after > DIVERGED_DB);
            let recovered = end.map_or(String::new(), |end| format!(" before it rose to {end:.1}"));
            format!(
                "training diverged: PSNR on the training photos fell from {best:.1} to {after:.1} dB{recovered}; retry with another seed"
            )
        })
    }
}

/// Of evaluations of as many test views the best and the last, where the last is worse by more than [`OVERFITTED_DB`]: on the way fewer
/// views are looked at than at the end.
fn worsened(evaluations: &[Evaluation]) -> Option<[Evaluation; 2]> {
    evaluations.iter().rev().find_map(|last| {
        let mut alike = evaluations.iter().filter(|evaluation| evaluation.views == last.views);
        let best = alike.clone().max_by(|a, b| a.quality.psnr.total_cmp(&b.quality.psnr))?;
        let is_last = alike.next_back() == Some(last);
        (is_last && best.quality.psnr - last.quality.psnr > OVERFITTED_DB).then_some([*best, *last])
    })
}

/// By how much the last fifth of a training is better than the one before it, where that is more than [`RISING_DB`].
fn rising(curve: &[CurvePoint]) -> Option<f64> {
    let means = parts(curve, 5);
    let [.., before, last] = means[..] else { return None };
    Some(last - before).filter(|rise| rise.is_finite() && *rise > RISING_DB)
}

/// The mean of those that are finite; infinite where none is.
pub(super) fn finite_mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.filter(|value| value.is_finite()).fold((0.0, 0.0), |(s, n), value| (s + value, n + 1.0));
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

/// Means of the finite PSNR of a training's parts, of one length but for the last; at most `count`.
fn parts(curve: &[CurvePoint], count: usize) -> Vec<f64> {
    let parts = curve.chunks(curve.len().div_ceil(count).max(1));
    parts.map(|part| finite_mean(part.iter().map(|point| point.psnr))).collect()
}

/// What [`TrainRecord::diverged`] finds in a curve.
fn fall(curve: &[CurvePoint], strategy: Strategy) -> Option<[f64; 2]> {
    // Adaptive density control resets all opacities, and recovers.
    let passing = || if strategy == Strategy::Mcmc { fallen_on_the_way(curve) } else { None };
    passing().or_else(|| fallen(curve))
}

/// PSNR in the best and in the last fifth of a training, where the last is worse by more than [`DIVERGED_DB`].
fn fallen(curve: &[CurvePoint]) -> Option<[f64; 2]> {
    let means = parts(curve, 5);
    let best = means.iter().copied().filter(|mean| mean.is_finite()).fold(f64::NEG_INFINITY, f64::max);
    let last = *means.last()?;
    (best - last > DIVERGED_DB).then_some([best, last])
}

/// PSNR before and after the deepest fall between two fifteenths of a training, where that is more than [`PASSING_DB`].
fn fallen_on_the_way(curve: &[CurvePoint]) -> Option<[f64; 2]> {
    let means = parts(curve, 15);
    let falls = (0..means.len()).map(|i| {
        let before = means[..=i].iter().copied().filter(|mean| mean.is_finite()).fold(f64::NEG_INFINITY, f64::max);
        [before, means[i]]
    });
    falls.filter(|[before, after]| before - after > PASSING_DB).max_by(|a, b| (a[0] - a[1]).total_cmp(&(b[0] - b[1])))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn training(psnr: &[f64]) -> Vec<CurvePoint> {
        psnr.iter().map(|psnr| CurvePoint { psnr: *psnr, ..CurvePoint::default() }).collect()
    }

    /// If this failed, a training that diverged would not be reported, or one that did not would be. The second training is
    /// that of a room which diverged, a point of sixteen; the third has a reset of the opacities.
    #[test]
    fn a_fall_is_one_that_lasts() {
        assert_eq!(fallen(&training(&[12.6, 18.8, 18.7, 19.8, 20.1, 20.2, 20.6, 20.2, 20.0, 21.0])), None);
        let room = [
            12.6, 17.7, 19.3, 19.3, 19.5, 20.1, 20.2, 20.2, 20.2, 19.9, 18.0, 15.2, 15.6, 15.1, 15.1, 15.3, 15.5, 14.7,
            16.1, 14.8, 14.6, 15.1, 16.5, 16.8, 16.2,
        ];
        let [best, last] = fallen(&training(&room)).expect("it diverged");
        assert!((best - 20.12).abs() < 0.01 && (last - 15.84).abs() < 0.01, "{best} and {last}");
        assert_eq!(fallen(&training(&[15.0, 20.0, 9.0, 21.0, 22.0])), None);
        assert_eq!(fallen(&[]), None);
        // Of 300 iterations, and of 30,000.
        let short = [10.1, 11.0, 12.4, 13.1, 14.0, 14.6, 15.2, 15.6, 16.1, 16.4];
        assert!(rising(&training(&short)).is_some_and(|rise| (rise - 0.85).abs() < 1e-9));
        assert_eq!(rising(&training(&[20.0, 25.0, 27.0, 28.0, 28.1])), None);
        assert_eq!(rising(&training(&[20.0])), None);
        // Dark photos that are rendered exactly.
        let endless = f64::INFINITY;
        assert_eq!(fallen(&training(&[endless, 20.0, 20.5, 21.0, 21.0])), None);
        assert_eq!(
            fallen(&training(&[15.0, endless, 20.0, 20.5, 21.0, 20.0, 16.0, endless, 15.0, endless])),
            Some([20.5, 15.0])
        );
        assert_eq!(fallen(&training(&[endless; 5])), None);
    }

    /// Fifteenths of two trainings of a room by MCMC, of which the first fell and recovered and the second stood still for a while. If this
    /// failed, a training that lost 12 dB for most of its time would count as a sound measurement of its photos, or a sound one would not.
    #[test]
    fn a_fall_on_the_way_counts_where_it_is_deep() {
        let fell = [23.8, 31.6, 32.0, 29.8, 25.7, 23.4, 21.9, 21.2, 20.3, 21.2, 22.2, 22.1, 26.3, 30.0, 30.6];
        let stood = [24.6, 32.4, 33.1, 32.4, 32.0, 33.0, 34.3, 35.0, 35.8, 36.2, 36.7, 37.1, 38.8, 39.7, 40.0];
        let falls = |psnr: &[f64], strategy| fall(&training(psnr), strategy);
        assert_eq!(falls(&fell, Strategy::Mcmc), Some([32.0, 20.3]));
        assert_eq!(falls(&fell, Strategy::Adc), None, "opacities that are reset come back");
        assert_eq!(falls(&stood, Strategy::Mcmc), None);
        // Of photos that are rendered exactly, and of few points.
        assert_eq!(falls(&[30.0, f64::INFINITY, 31.0, 27.5, 32.0], Strategy::Mcmc), Some([31.0, 27.5]));
        assert_eq!(falls(&[f64::INFINITY; 3], Strategy::Mcmc), None);
        assert_eq!(falls(&[], Strategy::Mcmc), None);
    }
}
