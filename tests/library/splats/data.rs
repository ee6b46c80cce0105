//! What Gaussians are trained on, of captures that other programs made, in the folder that CAMSPLAT_DATA names.

use std::time::Instant;

use crate::support::data::data_folder;
use camsplat::files::io::photos::{Images, ReadOptions, read};
use camsplat::files::photos::{Photo, PhotoSet};
use camsplat::splats::data::pictures::{self, Picture, PictureSettings, UNKNOWN, picture_bytes, pictures};
use camsplat::splats::data::split::{Split, Test};
use camsplat::splats::data::start::{self, start};
use camsplat::splats::render::frame::Frame;
use glam::Vec3;

/// A capture of the data folder.
fn capture(name: &str) -> PhotoSet {
    read(&data_folder().join(name), &ReadOptions { images: Images::Needed, ..ReadOptions::default() }).unwrap()
}

fn load(photos: &[Photo], shrink: u32) -> Vec<Picture> {
    let clock = Instant::now();
    let settings = PictureSettings { shrink, ..PictureSettings::default() };
    let mut decoder = pictures(photos, &settings).unwrap();
    let all: Vec<Picture> = decoder.by_ref().map(Result::unwrap).collect();
    println!(
        "{} pictures in {:.2} s, {:.0} MB, {:.0} MB on their way at most",
        all.len(),
        clock.elapsed().as_secs_f64(),
        1e-6 * picture_bytes(photos, shrink) as f64,
        1e-6 * decoder.most_in_flight() as f64
    );
    let bytes: u64 = all.iter().map(|picture| 4 * picture.pixels.len() as u64).sum();
    assert_eq!(picture_bytes(photos, shrink), bytes);
    assert!(all.iter().zip(0..).all(|(picture, i)| picture.index == i));
    all
}

/// Shares of pixels that are unknown, transparent and opaque.
fn shares(pictures: &[Picture]) -> [f64; 3] {
    let all: usize = pictures.iter().map(|picture| picture.pixels.len()).sum();
    let share = |is: fn(u32) -> bool| {
        let count = |picture: &Picture| picture.pixels.iter().filter(|pixel| is(**pixel)).count();
        pictures.iter().map(count).sum::<usize>() as f64 / all as f64
    };
    assert_eq!(share(|pixel| pixel >> 24 == 0 && pixel != 0 && pixel != UNKNOWN), 0.0);
    [share(|pixel| pixel == UNKNOWN), share(|pixel| pixel == 0), share(|pixel| pixel >> 24 == 255)]
}

/// If this failed, a standard capture with a distorted lens would be trained on as it is, or lose much of its pixels.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn fox_is_straightened_and_hardly_loses_a_pixel() {
    let set = capture("photos/fox");
    let split = Split::new(set, &Test::Default, Images::Needed.into()).unwrap();
    assert_eq!((split.train.photos.len(), split.test.len()), (58, 9));
    let pictures = load(&split.train.photos, 1);
    let [unknown, transparent, opaque] = shares(&pictures);
    println!("{:.2}% unknown", 100.0 * unknown);
    assert!(unknown > 0.0 && unknown < 0.03 && transparent == 0.0 && unknown + opaque == 1.0, "{unknown}");
}

/// The share of points whose projections by the views lie on known pixels that resemble them. If this failed, pictures, cameras
/// and points would not be of one frame.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn views_see_the_points_where_the_pictures_show_them() {
    let set = capture("photos/fox");
    let frame = Frame::new(&set.cameras(), &set.points.positions);
    let pictures = load(&set.photos, 2);
    let start = start(&set, &frame, &start::StartSettings::default()).unwrap();
    assert_eq!(start.len(), 12_528);
    let (mut difference, mut shuffled, mut seen) = (0.0, 0.0, 0);
    for (i, track) in set.tracks.iter().enumerate() {
        for &photo in track {
            let view = frame.view(&pictures::cameras(&set.photos, 2)[photo as usize]);
            let along = |row: [f32; 4]| Vec3::new(row[0], row[1], row[2]).dot(start.centres[i].as_vec3()) + row[3];
            let [x, y, depth] = [view.row_x, view.row_y, view.row_z].map(along);
            let x = view.focal[0] * x / depth + view.principal[0];
            let y = view.focal[1] * y / depth + view.principal[1];
            if depth < view.near || x < 0.0 || y < 0.0 || x >= view.width as f32 || y >= view.height as f32 {
                continue;
            }
            let pixel = pictures[photo as usize].pixels[(y as u32 * view.width + x as u32) as usize];
            let off = |colour: [u8; 3]| {
                (0..3).map(|c| (f64::from(pixel.to_le_bytes()[c]) - f64::from(colour[c])).abs()).sum::<f64>() / 3.0
            };
            difference += off(set.points.colours[i]);
            shuffled += off(set.points.colours[(i + 5000) % set.points.colours.len()]);
            seen += 1;
        }
    }
    let (difference, shuffled) = (difference / f64::from(seen), shuffled / f64::from(seen));
    println!("{seen} observations: {difference:.1} levels off, {shuffled:.1} of other points");
    assert!(difference < 0.5 * shuffled && difference < 20.0);
}

/// If this failed, the turntable's background, which does not turn with it, would be learnt.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn masks_cut_the_tankard_out() {
    let set = capture("photos/tankard");
    let [unknown, transparent, opaque] = shares(&load(&set.photos, 1));
    println!("{:.1}% outside the masks", 100.0 * transparent);
    assert!(unknown == 0.0 && transparent > 0.2 && opaque > 0.2);
}

/// If this failed, the biggest capture of the folder would take more time or memory than its pictures need.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn gold_cape_loads() {
    let set = capture("photos/gold-cape");
    let [unknown, transparent, opaque] = shares(&load(&set.photos, 1));
    assert!(unknown == 0.0 && transparent > 0.2 && opaque > 0.1);
}

/// If this failed, the synthetic scene would be trained on a black or white background, tested on its training views, or start
/// empty.
#[test]
#[ignore = "needs the folder CAMSPLAT_DATA"]
fn lego_has_alpha_its_own_test_views_and_a_random_start() {
    let set = capture("nerf-synthetic/lego");
    let split = Split::new(set, &Test::Default, Images::Needed.into()).unwrap();
    println!("{}", split.notes.join("\n"));
    assert_eq!((split.train.photos.len(), split.test.len(), split.notes.len()), (100, 50, 1));
    for photos in [&split.train.photos, &split.test] {
        let [unknown, transparent, opaque] = shares(&load(photos, 1));
        assert!(unknown == 0.0 && transparent > 0.5 && opaque > 0.1 && transparent + opaque < 1.0);
    }
    let frame = Frame::new(&split.train.cameras(), &[]);
    let start = frame.gaussians_to_world(start(&split.train, &frame, &start::StartSettings::default()).unwrap());
    let reach = start.centres.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    println!("{} Gaussians within {reach:.2}, an extent of {:.2}", start.len(), frame.extent());
    // The model reaches to about 1.2.
    assert!(start.len() == 100_000 && reach > 1.2 && reach < 1.7);
}
