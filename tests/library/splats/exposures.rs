//! Exposures of photos on the device, against the twin; and what they are learnt to be.

use std::path::Path;

use crate::support::device::{context, silent};
use crate::support::splats::capture;
use camsplat::Result;
use camsplat::engine::vulkan::{Buffer, Recorder};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::random::uniforms;
use camsplat::splats::config::{Start, Strategy, TrainConfig};
use camsplat::splats::exposure::Exposure;
use camsplat::splats::render::frame::Frame;
use camsplat::splats::render::layout::PassPush;
use camsplat::splats::render::rasterizer::{Size, Sizes};
use camsplat::splats::run::record::{PhotoExposure, TrainRecord};
use camsplat::splats::train::exposure::{ExposureState, Exposures, PULL};
use glam::DVec3;

/// If this failed, exposures would be learnt along another slope than their formula has, or splats and what is left of the light behind
/// them pay for what a photo's exposure is.
#[test]
fn stages_agree_with_the_twin() -> Result<()> {
    let context = context();
    // No multiple of a workgroup's pixels.
    let size = Size { width: 37, height: 23 };
    let pixels = size.pixels() as usize;
    let pose = Pose::looking(DVec3::NEG_Z, DVec3::Z, DVec3::Y);
    let camera = Camera { name: "a".into(), pose, intrinsics: Intrinsics::from_fov(size.width, size.height, 1.0) };
    let views = Buffer::from_slice(&context, "views", &[Frame::new(&[], &[]).view(&camera); 3])?;
    let sizes = Sizes { gaussians: 1, capacity: 1, pixels: size.pixels(), tiles: size.tiles() };
    let exposures = Exposures::new(&context, &sizes, 3, 3, 10)?;
    let value = |k: u32, i: usize| uniforms(7, k, i as u32)[0] as f32;
    let mut states = [ExposureState::default(); 3];
    for (i, state) in states.iter_mut().enumerate() {
        state.value = std::array::from_fn(|k| 0.3 * (value(40 + i as u32, k) - 0.5));
    }
    exposures.restore(&states)?;
    let drawn: Vec<[f32; 4]> = (0..pixels).map(|i| [0, 1, 2, 3].map(|k| value(k, i))).collect();
    let by_shown: Vec<[f32; 4]> =
        (0..pixels).map(|i| [value(4, i) - 0.5, value(5, i) - 0.5, value(6, i) - 0.5, 0.0]).collect();
    let picture = Buffer::from_slice(&context, "picture", &drawn)?;
    let by_pixel = Buffer::from_slice(&context, "by_pixel", &by_shown)?;
    let control = Buffer::from_slice(&context, "control", &[0u32])?;
    let background = [0.2f32, 0.5, 0.9];
    let push = PassPush { view: 1, background, ..PassPush::default() };
    let mut commands = Recorder::new(&context)?;
    exposures.record_apply(&mut commands, [&views, &picture], size, &push);
    commands.submit_and_wait()?;
    drop(commands);
    let shown: Vec<[f32; 4]> = picture.download(pixels)?;
    let mut commands = Recorder::new(&context)?;
    exposures.record_step(&mut commands, [&views, &picture, &by_pixel, &control], size, &push);
    commands.submit_and_wait()?;
    drop(commands);
    let (backward, by_own): (Vec<[f32; 4]>, Vec<[f32; 4]>) = (picture.download(pixels)?, by_pixel.download(pixels)?);

    let twin = Exposure::from_device(&states[1].value);
    let behind = DVec3::from(background.map(f64::from));
    let three = |v: [f32; 4]| DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]));
    let mut rows = [glam::DVec4::ZERO; 3];
    for i in 0..pixels {
        let left = f64::from(drawn[i][3]);
        let (known, by_rows) = twin.gradient(three(drawn[i]), left, behind, three(by_shown[i]));
        rows.iter_mut().zip(by_rows).for_each(|(sum, row)| *sum += row);
        assert!(three(shown[i]).distance(twin.shown(three(drawn[i]), left, behind)) < 1e-5, "pixel {i}");
        assert!(three(by_own[i]).distance(known) < 1e-5, "pixel {i}");
        assert!(three(backward[i]).distance(twin.for_backward(three(drawn[i]), left, behind)) < 1e-4, "pixel {i}");
    }
    let after = exposures.states()?;
    for k in 0..12 {
        // A tenth of the gradient, with what draws towards no change, is Adam's first mean after the first step.
        let gradient = rows[k / 4][k % 4] + f64::from(PULL * states[1].value[k]);
        let (found, known) = (f64::from(after[1].first[k]), 0.1 * gradient);
        assert!((found - known).abs() < 1e-4 * (1.0 + known.abs()), "number {k}: {found} and not {known}");
        assert_eq!((after[0].first[k], after[0].steps, after[1].steps), (0.0, 0.0, 1.0));
        // A step of the whole rate against the gradient; then the mean of all is taken away.
        let stepped = |i: usize| f64::from(states[i].value[k]) - if i == 1 { 1e-2 * known.signum() } else { 0.0 };
        let mean = (stepped(0) + stepped(1) + stepped(2)) / 3.0;
        for (i, after) in after.iter().enumerate() {
            let (found, known) = (f64::from(after.value[k]), stepped(i) - mean);
            assert!((found - known).abs() < 1e-5, "view {i}, number {k}: {found} and not {known}");
        }
    }
    // A run that is halted changes nothing.
    control.upload(&[1u32])?;
    let mut commands = Recorder::new(&context)?;
    exposures.record_step(&mut commands, [&views, &picture, &by_pixel, &control], size, &push);
    commands.submit_and_wait()?;
    drop(commands);
    assert_eq!(exposures.states()?, after);
    silent(&context);
    Ok(())
}

/// Trains on a capture whose photos are darkened and brightened by turns, by `gain`; every fourth is tested with.
fn trained(gain: f64, exposure: bool) -> TrainRecord {
    let folder = tempfile::tempdir().unwrap();
    capture::write(folder.path(), 16, 48);
    for (i, entry) in sorted(&folder.path().join("images")).into_iter().enumerate() {
        let mut image = image::open(&entry).unwrap().into_rgb8();
        let gain = if i % 2 == 0 { gain } else { 1.0 / gain };
        image.iter_mut().for_each(|v| *v = (f64::from(*v) * gain).round().min(255.0) as u8);
        image.save(&entry).unwrap();
    }
    let config = TrainConfig::new(600, 300).with_strategy(Strategy::Mcmc, Start::Points);
    let context = context();
    let record = capture::trained(&context, folder.path(), TrainConfig { degree: 0, exposure, ..config });
    silent(&context);
    record
}

fn sorted(folder: &Path) -> Vec<std::path::PathBuf> {
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// If this failed, photos of a phone would train to a mean of their exposures, or exposures be learnt that nobody took.
#[test]
fn exposures_are_learnt_and_colours_do_not_drift() {
    let psnr = |record: &TrainRecord| record.evaluations.last().unwrap().quality.psnr;
    let (with, without) = (trained(1.2, true), trained(1.2, false));
    assert!(psnr(&with) > psnr(&without) + 3.0, "{} and {} dB", psnr(&with), psnr(&without));
    assert!(without.exposures.is_empty() && with.exposures.len() == 12);
    // Photos 0, 4, 8 and 12 are tested with: even ones are bright, odd ones dark.
    let gain = |exposure: &PhotoExposure| exposure.gains().iter().sum::<f64>() / 3.0;
    for exposure in &with.exposures {
        let i: u32 = exposure.name[..3].parse().unwrap();
        let wrong = if i.is_multiple_of(2) { gain(exposure) < 1.05 } else { gain(exposure) > 0.95 };
        assert!(!wrong, "{}: {}", exposure.name, gain(exposure));
    }
    let mean = with.exposures.iter().map(gain).sum::<f64>() / 12.0;
    assert!((mean - 1.0).abs() < 1e-3, "{mean}");
    // Where all photos are alike, what is learnt is less than a tenth of that drift.
    let alike = trained(1.0, true);
    for exposure in &alike.exposures {
        assert!((gain(exposure) - 1.0).abs() < 0.02, "{}: {}", exposure.name, gain(exposure));
    }
    let plain = trained(1.0, false);
    println!("alike: {:.2} dB, {:.2} dB without", psnr(&alike), psnr(&plain));
    // A model that is far from done takes some of what it cannot show yet for exposure, and no more than this.
    assert!(psnr(&alike) > psnr(&plain) - 1.0, "{} and {} dB", psnr(&alike), psnr(&plain));
}
