//! How close a surface made from photos alone comes to the reference: the table of docs/reference/proxy.md.
//!
//! `cargo run --release --example proxy_accuracy -- DATA [--pictures DIR] [SET:PHOTOS]...` reads the sets under DATA, makes a
//! proxy of each and prints a row for each. The reference is the set's own sparse points, those within the masks where there are
//! masks, or, where a set has no points, the hull of all its photos. Distances are in parts of the longest side of the
//! reference's bounds, less its outermost hundredth on each side. With --pictures it draws each proxy as three of its cameras see it.

use std::error::Error;
use std::path::{Path, PathBuf};

use camsplat::engine::vulkan::Context;
use camsplat::files::io::photos;
use camsplat::files::photos::PhotoSet;
use camsplat::photogrammetry::stereo::frame::Frame;
use camsplat::photogrammetry::stereo::{StereoOptions, reconstruct};
use camsplat::scene::camera::Camera;
use camsplat::scene::similarity::Similarity;
use camsplat::scene::surface::Points;
use glam::{DVec2, DVec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};

/// Distances that count as close, in parts of the object's size.
const THRESHOLDS: [f64; 3] = [0.01, 0.02, 0.05];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let data = PathBuf::from(arguments.next().ok_or("give the folder of the data")?);
    let (mut pictures, mut cases) = (None, Vec::new());
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--pictures" => pictures = Some(PathBuf::from(arguments.next().ok_or("--pictures takes a folder")?)),
            case => {
                let (set, count) = case.split_once(':').ok_or("give SET:PHOTOS")?;
                cases.push((set.to_owned(), count.parse()?));
            }
        }
    }
    if cases.is_empty() {
        let sets = ["photos/gold-cape", "nerf-synthetic/lego", "photos/tankard", "photos/fox", "photos/plush"];
        cases = sets.iter().map(|set| ((*set).to_owned(), 10)).collect();
    }
    let context = Context::new(&camsplat::engine::vulkan::ContextOptions::default())?;
    println!(
        "| set | photos | reference | points, of these from stereo | reference within 1 / 2 / 5% of the proxy | proxy within 1 / 2 / 5% of the reference | seconds |"
    );
    println!("|---|---|---|---|---|---|---|");
    for (name, photos) in cases {
        let set = photos::read(&data.join(&name), &photos::ReadOptions::default())?;
        let options = StereoOptions { photos, ..StereoOptions::default() };
        let found = reconstruct(&context, &set, &options)?;
        let (what, reference) = reference(&context, &set)?;
        let size = size(&reference);
        let complete = within(&reference, &found.points.positions, size);
        let accurate = within(&found.points.positions, &reference, size);
        let seconds: f64 = found.seconds.iter().map(|(_, seconds)| seconds).sum();
        println!(
            "| {name} | {photos} | {} {what} | {}, {} | {complete} | {accurate} | {seconds:.1} |",
            reference.len(),
            found.points.positions.len(),
            found.from_depths
        );
        if let Some(folder) = &pictures {
            let used: Vec<&Camera> = set
                .photos
                .iter()
                .map(|photo| &photo.camera)
                .filter(|camera| found.photos.contains(&camera.name))
                .collect();
            draw(&folder.join(format!("{}-{photos}.png", name.replace('/', "-"))), &found.points, &used)?;
        }
    }
    Ok(())
}

/// What the proxy is compared with: its name and points.
fn reference(context: &std::sync::Arc<Context>, set: &PhotoSet) -> Result<(&'static str, Vec<DVec3>), Box<dyn Error>> {
    if set.points.positions.is_empty() {
        let all = StereoOptions { photos: usize::MAX, ..StereoOptions::default() };
        return Ok(("points of the hull", camsplat::photogrammetry::stereo::hull_of(context, set, &all)?.positions));
    }
    if set.photos.iter().all(|photo| photo.mask.is_none()) {
        return Ok(("sparse points", set.points.positions.clone()));
    }
    let frames = Frame::read(&set.photos, 480, 1 << 30, &Similarity::IDENTITY, Err)?;
    // A point of the object is in the mask of nearly every photo that it was found in.
    let masked = |i: &usize| {
        let track = &set.tracks[*i];
        let covered = track.iter().filter(|view| covers(&frames[**view as usize], set.points.positions[*i])).count();
        10 * covered >= 9 * track.len()
    };
    let kept = (0..set.points.positions.len()).filter(masked);
    Ok(("sparse points in the masks", kept.map(|i| set.points.positions[i]).collect()))
}

/// Whether a point is in a frame's mask.
fn covers(frame: &Frame, point: DVec3) -> bool {
    let Some((pixel, _)) = project(&frame.camera, point) else { return false };
    let index = pixel.y as usize * frame.camera.intrinsics.width as usize + pixel.x as usize;
    frame.mask.as_ref().is_none_or(|mask| mask[index] > 0.5)
}

/// Pixel and depth of a point; none outside the picture.
fn project(camera: &Camera, point: DVec3) -> Option<(DVec2, f64)> {
    let p = camera.pose.rotation.inverse() * (point - camera.pose.position);
    let pixel = DVec2::from(camera.intrinsics.focal) * p.truncate() / p.z + DVec2::from(camera.intrinsics.principal);
    camera.sees(point).then_some((pixel, p.z))
}

/// Longest side of the bounds, less the outermost hundredth on each side.
fn size(points: &[DVec3]) -> f64 {
    let side = |axis: usize| {
        let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
        values.sort_unstable_by(f64::total_cmp);
        values[values.len() - 1 - values.len() / 100] - values[values.len() / 100]
    };
    (0..3).map(side).fold(0.0, f64::max)
}

/// How many of `points` have one of `others` within each threshold, as a text.
fn within(points: &[DVec3], others: &[DVec3], size: f64) -> String {
    let coordinates: Vec<[f64; 3]> = others.iter().map(DVec3::to_array).collect();
    let Ok(tree) = ImmutableKdTree::<f64, 3>::builder().build_from_slice(&coordinates) else {
        return "no points".into();
    };
    let distances: Vec<f64> = points
        .iter()
        .map(|p| tree.query(&p.to_array()).nearest_one::<SquaredEuclidean<f64>>().execute().distance.sqrt() / size)
        .collect();
    let share = |limit: f64| distances.iter().filter(|d| **d <= limit).count() as f64 / distances.len() as f64;
    THRESHOLDS.map(|limit| format!("{:.1}", 100.0 * share(limit))).join(" / ") + "%"
}

/// Draws points as three of the cameras see them: above by colour, below by how they face the camera.
fn draw(path: &Path, points: &Points, cameras: &[&Camera]) -> Result<(), Box<dyn Error>> {
    const SIDE: u32 = 480;
    let mut picture = image::RgbImage::from_pixel(3 * SIDE, 2 * SIDE, image::Rgb([40, 40, 60]));
    for (column, k) in (0..3u32).zip([0, cameras.len() / 3, 2 * cameras.len() / 3]) {
        let camera = cameras[k];
        let scale = f64::from(SIDE) / f64::from(camera.intrinsics.width.max(camera.intrinsics.height));
        let mut nearest = vec![f64::INFINITY; (SIDE * SIDE) as usize];
        for (i, &point) in points.positions.iter().enumerate() {
            let Some((pixel, depth)) = project(camera, point) else { continue };
            let facing = -points.normals[i].dot((point - camera.pose.position).normalize());
            let half = (f64::from(points.radii[i]) * camera.intrinsics.focal[0] * scale / depth).clamp(0.5, 6.0);
            let centre = scale * pixel;
            let bounds = |c: f64| (c - half).max(0.0) as u32..((c + half).max(0.0) as u32 + 1).min(SIDE);
            for y in bounds(centre.y) {
                for x in bounds(centre.x) {
                    let at = (y * SIDE + x) as usize;
                    if depth >= nearest[at] {
                        continue;
                    }
                    nearest[at] = depth;
                    let shade = (255.0 * facing.abs()) as u8;
                    let normal = if facing > 0.0 { [shade; 3] } else { [shade, 0, 0] };
                    picture.put_pixel(column * SIDE + x, y, image::Rgb(points.colours[i]));
                    picture.put_pixel(column * SIDE + x, SIDE + y, image::Rgb(normal));
                }
            }
        }
    }
    Ok(picture.save(path)?)
}
