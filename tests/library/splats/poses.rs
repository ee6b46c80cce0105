//! Corrections of poses on the device, against the twin; and what they are learnt to be.

use std::path::Path;

use crate::support::device::{context, silent};
use crate::support::splats::{Draws, capture, pass, photo, scene, twin_view, view};
use camsplat::Result;
use camsplat::engine::vulkan::{Buffer, Context, Recorder};
use camsplat::files::io;
use camsplat::scene::camera::{Camera, Pose};
use camsplat::scene::lens::{Distortion, Lens};
use camsplat::splats::config::{Start, Strategy, TrainConfig};
use camsplat::splats::pose::PoseCorrection;
use camsplat::splats::render::frame::View;
use camsplat::splats::render::rasterizer::{Model, Sizes};
use camsplat::splats::render::wanted::Wanted;
use camsplat::splats::run::record::TrainRecord;
use camsplat::splats::train::poses::{PoseState, Poses};
use camsplat::splats::twin;
use glam::{DMat3, DQuat, DVec3};

const BACKGROUND: [f32; 3] = [0.2, 0.5, 0.9];

/// If this failed, cameras would be moved along another slope than the loss has.
#[test]
fn what_gaussians_pull_with_is_the_gradient_by_the_pose() -> Result<()> {
    let context = context();
    let cases = [
        ("one splat", 1, 0, false),
        ("degree 3", 300, 3, false),
        ("antialiased", 300, 3, true),
        ("many", 3000, 0, false),
    ];
    for (seed, (name, count, degree, antialiased)) in cases.into_iter().enumerate() {
        let (gaussians, view) = (scene(seed as u64, count, degree), view(96, 64));
        let wanted = Wanted { antialiased, depths: true, gradients: true, ..Wanted::default() };
        let pass = pass(&context, &gaussians, view, &photo(seed as u64, &view), BACKGROUND, wanted, 1 << 17)?;
        let by_pixel: Vec<DVec3> =
            pass.by_pixel.iter().map(|p| DVec3::new(p[0].into(), p[1].into(), p[2].into())).collect();
        let rules = twin::Rules { antialiased, ..twin::Rules::default() };
        let background = DVec3::from(BACKGROUND.map(f64::from));
        let known = twin::by_pose(&twin::splats(&gaussians), &twin_view(&view), &rules, background, &by_pixel);
        let sum =
            |plane: usize| pass.forces[plane * count..(plane + 1) * count].iter().map(|v| f64::from(*v)).sum::<f64>();
        for (of, known) in known.into_iter().enumerate() {
            let found = -DVec3::new(sum(3 * of), sum(3 * of + 1), sum(3 * of + 2));
            assert!(found.distance(known) < 1e-4 * known.length() + 1e-9, "{name}, {of}: {found} and not {known}");
        }
    }
    silent(&context);
    Ok(())
}

/// A step of a view's correction after an iteration in which Gaussians pulled with `forces`, in planes.
fn stepped(
    context: &std::sync::Arc<Context>,
    poses: &Poses,
    forces: &[f32],
    views: &Buffer,
    halted: bool,
) -> Result<()> {
    let count = forces.len() as u32 / 6;
    let forces = Buffer::from_slice(context, "forces", forces)?;
    let model = Model {
        parameters: Buffer::device(context, "parameters", 4)?,
        // The last Gaussian's place is free.
        population: Buffer::from_slice(context, "population", &[count - 1])?,
        stride: count,
        planes: 1,
    };
    let control = Buffer::from_slice(context, "control", &[u32::from(halted)])?;
    let mut commands = Recorder::new(context)?;
    poses.record_step(&mut commands, &model, [views, &control, &forces], (1, 1e-2));
    commands.submit_and_wait().map(drop)
}

/// If this failed, sums would lose Gaussians or count what is none, steps go the wrong way, the scene drift off with its cameras, or views
/// differ from the corrections that are written.
#[test]
fn steps_and_views_agree_with_the_twin() -> Result<()> {
    let context = context();
    let mut draw = Draws::new(3);
    let mut given = [view(40, 30); 3];
    given.iter_mut().for_each(|view| view.position[0] += 0.3 * draw.one() as f32);
    // More than two workgroups sum, the last of them few.
    let count = 2051;
    let forces: Vec<f32> = (0..6 * count).map(|_| draw.one() as f32).collect();
    let sizes = Sizes { gaussians: count, capacity: 1, pixels: 1, tiles: 1 };
    let poses = Poses::new(&context, &sizes, &given, 3)?;
    let views = Buffer::from_slice(&context, "views", &given)?;
    let mut states = [PoseState::default(); 3];
    states.iter_mut().for_each(|state| state.value = std::array::from_fn(|_| 0.2 * draw.one() as f32));
    poses.restore(&context, &states, &views)?;
    stepped(&context, &poses, &forces, &views, false)?;
    let after = poses.states()?;
    for k in 0..6 {
        let plane = &forces[k * count as usize..(k + 1) * count as usize - 1];
        let known = -plane.iter().map(|v| f64::from(*v)).sum::<f64>();
        // Adam's first mean is a tenth of the gradient, its first step the whole rate against it.
        let found = 10.0 * f64::from(after[1].first[k]);
        assert!((found - known).abs() < 1e-3, "number {k}: {found} and not {known}");
        assert_eq!((after[0].first[k], after[0].steps, after[1].steps), (0.0, 0.0, 1.0));
        let moved = |i: usize| f64::from(states[i].value[k]) - if i == 1 { 1e-2 * known.signum() } else { 0.0 };
        let mean = (moved(0) + moved(1) + moved(2)) / 3.0;
        for (i, after) in after.iter().enumerate() {
            let (found, known) = (f64::from(after.value[k]), moved(i) - mean);
            assert!((found - known).abs() < 1e-5, "view {i}, number {k}: {found} and not {known}");
        }
    }
    let found: Vec<View> = views.download(3)?;
    for ((state, given), found) in after.iter().zip(&given).zip(&found) {
        let known = PoseCorrection::from_device(&state.value).of_view(given);
        let rows = |view: &View| [view.row_x, view.row_y, view.row_z].concat();
        let apart = rows(&known).iter().zip(rows(found)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(apart < 2e-6, "{apart}");
        assert!(known.position.iter().zip(found.position).all(|(a, b)| (a - b).abs() < 1e-6));
        assert_eq!((known.focal, known.width), (found.focal, found.width));
    }
    // Neither a run that is halted changes anything, nor a gradient that is no number.
    stepped(&context, &poses, &forces, &views, true)?;
    let broken: Vec<f32> = forces.iter().enumerate().map(|(i, v)| if i == 2500 { f32::NAN } else { *v }).collect();
    stepped(&context, &poses, &broken, &views, false)?;
    assert_eq!(poses.states()?, after);
    assert_eq!(views.download::<View>(3)?, found);
    silent(&context);
    Ok(())
}

/// Writes a capture whose poses are off by half a degree and half a hundredth of the distance or so; cameras as they are and as they are given.
fn disturbed(folder: &Path, count: u32) -> [Vec<Camera>; 2] {
    capture::write(folder, count, 48);
    let truth = capture::cameras(count, 48);
    let mut draw = Draws::new(5);
    let mut cameras = truth.clone();
    for camera in &mut cameras {
        camera.pose.position += 0.025 * draw.vector();
        camera.pose.rotation = DQuat::from_scaled_axis(0.012 * draw.vector()) * camera.pose.rotation;
    }
    std::fs::write(folder.join("transforms.json"), io::transforms::write(&cameras, Some("points.ply"))).unwrap();
    [truth, cameras]
}

/// Mean distance in pixels between where two poses of a camera see what there is to see.
fn apart(camera: &Camera, other: &Pose) -> f64 {
    let seen = |pose: &Pose, point: DVec3| {
        let local = pose.rotation.inverse() * (point - pose.position);
        Lens::new(camera.intrinsics, Distortion::default()).project(local).unwrap()
    };
    let points = capture::truth().centres;
    points.iter().map(|point| seen(&camera.pose, *point).distance(seen(other, *point))).sum::<f64>()
        / points.len() as f64
}

fn trained(folder: &Path, refine_poses: bool) -> TrainRecord {
    let config = TrainConfig::new(900, 300).with_strategy(Strategy::Mcmc, Start::Points);
    let context = context();
    let record = capture::trained(&context, folder, TrainConfig { degree: 0, refine_poses, ..config });
    silent(&context);
    record
}

/// If this failed, poses that are a little off would blur the splats, or be corrected to others that nobody took.
#[test]
fn poses_are_corrected() {
    let folder = tempfile::tempdir().unwrap();
    let [truth, given] = disturbed(folder.path(), 16);
    let (without, with) = (trained(folder.path(), false), trained(folder.path(), true));
    let psnr = |record: &TrainRecord| record.evaluations.last().unwrap().quality.psnr;
    println!("{:.2} dB, {:.2} dB without", psnr(&with), psnr(&without));
    let file = folder.path().join("out/refined/transforms.json");
    let refined = io::read_cameras(&file).unwrap();
    // As a capture for other trainers: with its photos and points.
    let whole = io::photos::ReadOptions { outside_paths: true, ..io::photos::ReadOptions::default() };
    let capture = io::photos::read(&file, &whole).unwrap();
    assert_eq!(capture.photos.iter().filter(|photo| photo.image.is_some()).count(), 12);
    assert_eq!(capture.points.positions.len(), 80);
    assert!(psnr(&with) > psnr(&without) + 3.0, "{} and {} dB", psnr(&with), psnr(&without));
    assert!(without.poses.is_empty() && with.poses.len() == 12 && refined.len() == 12);
    let (mut before, mut after) = (0.0, 0.0);
    for (pose, refined) in with.poses.iter().zip(&refined) {
        let i = truth.iter().position(|camera| camera.name == pose.name).unwrap();
        before += apart(&truth[i], &given[i].pose) / 12.0;
        after += apart(&truth[i], &refined.pose) / 12.0;
        assert_eq!(refined.name, pose.name);
        assert!((given[i].pose.position.distance(refined.pose.position) - pose.moved).abs() < 1e-6, "{pose:?}");
        let turned = given[i].pose.rotation.angle_between(refined.pose.rotation).to_degrees();
        assert!((turned - pose.turned_deg).abs() < 1e-3, "{pose:?}");
        let matrix = DMat3::from_cols_array_2d(&pose.matrix.map(|row| [row[0], row[1], row[2]])).transpose();
        assert!(matrix.abs_diff_eq(DMat3::from_quat(refined.pose.rotation), 1e-6), "{pose:?}");
        assert!(DVec3::from(pose.matrix.map(|row| row[3])).distance(refined.pose.position) < 1e-6, "{pose:?}");
    }
    println!("{before:.2} pixels off, {after:.2} when corrected");
    assert!(before > 0.5 && after < 0.4 * before, "{before} and {after} pixels");
}
