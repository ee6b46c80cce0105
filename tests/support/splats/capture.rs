//! A small capture of our own making: coloured Gaussians seen from all around, rendered by the twin.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use camsplat::engine::vulkan::Context;
use camsplat::files::io;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::gaussians::Gaussians;
use camsplat::splats::config::TrainConfig;
use camsplat::splats::data::split::{Split, Test};
use camsplat::splats::render::frame::Frame;
use camsplat::splats::run::record::TrainRecord;
use camsplat::splats::run::request::{Run, TrainRequest};
use camsplat::splats::twin;
use glam::DVec3;

use super::{Draws, twin_view};

/// What there is to see: a ball of coloured Gaussians about the origin.
pub fn truth() -> Gaussians {
    let mut draw = Draws::new(11);
    let mut gaussians = Gaussians { degree: 0, ..Gaussians::default() };
    for _ in 0..80 {
        let place = draw.vector();
        gaussians.centres.push(0.6 * place / place.length().max(0.3));
        gaussians.log_scales.push([0, 1, 2].map(|_| (0.12f64.ln() + 0.3 * draw.one()) as f32));
        gaussians.rotations.push([1.0, draw.one() as f32, draw.one() as f32, draw.one() as f32]);
        gaussians.opacities.push(2.5);
        gaussians.harmonics.extend([0, 1, 2].map(|_| (1.5 * draw.one()) as f32));
    }
    gaussians
}

/// Cameras on a sphere of radius 3 that look at the origin.
pub fn cameras(count: u32, size: u32) -> Vec<Camera> {
    let mut draw = Draws::new(12);
    (0..count)
        .map(|i| {
            let position = 3.0 * draw.vector().normalize();
            let pose = Pose::looking(position, -position, DVec3::Z);
            let intrinsics = Intrinsics::from_fov(size, size - 7, 0.7);
            Camera { name: format!("{i:03}.png"), pose, intrinsics }
        })
        .collect()
}

/// Trains on a capture with every fourth photo held out, into its folder `out`.
pub fn trained(context: &Arc<Context>, capture: &Path, config: TrainConfig) -> TrainRecord {
    let options = io::photos::ReadOptions::default();
    let set = io::photos::read(capture, &options).unwrap();
    let request = TrainRequest {
        capture: "capture".into(),
        split: Split::new(set, &Test::Every(4), options).unwrap(),
        shrink: 1,
        folder: capture.join("out"),
        save_every: 0,
        evaluate_every: 0,
        config,
    };
    let run = Run::new(context, request).unwrap();
    run.run(false, None, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// Writes the capture: transforms.json, images, and points near the Gaussians' centres.
pub fn write(folder: &Path, count: u32, size: u32) {
    let cameras = cameras(count, size);
    let frame = Frame::new(&cameras, &[]);
    let truth = truth();
    let splats = twin::splats(&frame.gaussians_to_training(truth.clone()));
    std::fs::create_dir_all(folder.join("images")).unwrap();
    for camera in &cameras {
        let view = twin_view(&frame.view(camera));
        let picture = twin::render(&splats, &view, &twin::Rules::default(), DVec3::ZERO);
        let bytes: Vec<u8> = picture
            .colour
            .iter()
            .flat_map(|colour| colour.to_array().map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8))
            .collect();
        let image = image::RgbImage::from_raw(view.width, view.height, bytes).unwrap();
        image.save(folder.join("images").join(&camera.name)).unwrap();
    }
    let mut draw = Draws::new(13);
    let positions: Vec<DVec3> = truth.centres.iter().map(|centre| *centre + 0.05 * draw.vector()).collect();
    let points = io::ply::write::points(&positions, &vec![[128; 3]; positions.len()], None);
    std::fs::write(folder.join("points.ply"), points).unwrap();
    std::fs::write(folder.join("transforms.json"), io::transforms::write(&cameras, Some("points.ply"))).unwrap();
}
