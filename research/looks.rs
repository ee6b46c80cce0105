//! What laws of expected error are made of, for cameras of any kind: at 16 x 16 pixels of each test view, the angles of the nearest and of
//! the third nearest camera that sees the point, and how much larger the nearest one's pixels are there.
//!
//! ```text
//! cargo run --release --example looks -- SURFACE X0,Y0,Z0,X1,Y1,Z1|object TESTS OUT CAMERAS...
//! ```
//!
//! TESTS and CAMERAS are plan.json, transforms.json or folders of these. Writes OUT.json (where the pixels of each test view end, which are
//! beside the object, the number of cameras of each layout, and which test views show enough of the surface) and OUT.f32: layout by layout and pixel by pixel the two angles in radians
//! (2 where there is none) and the logarithm of its pixels' footprint over that of the viewer's, not below 0.

use std::fs;
use std::path::Path;

use camsplat::files::io::{plan_file, read_cameras_with_notes, read_surface};
use camsplat::lab::quality_fit::Observations;
use camsplat::planner::plan::config::Preset;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::planner::quality::law::Law;
use camsplat::planner::quality::look::Surroundings;
use camsplat::scene::camera::{Camera, Intrinsics};
use camsplat::scene::region::Shape;
use glam::DVec3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [surface, shape, tests, out, layouts @ ..] = &arguments[..] else {
        return Err("give SURFACE BOX|object TESTS OUT CAMERAS...".into());
    };
    let corners: Vec<f64> =
        if shape == "object" { Vec::new() } else { shape.split(',').map(str::parse).collect::<Result<_, _>>()? };
    let (preset, shape) = match corners[..] {
        [x0, y0, z0, x1, y1, z1] => {
            (Preset::Room, Some(Shape::Box { min: DVec3::new(x0, y0, z0), max: DVec3::new(x1, y1, z1) }))
        }
        _ => (Preset::Object, None),
    };
    let lens = Intrinsics::from_fov(512, 512, 50f64.to_radians());
    let choice = RegionChoice { shape, ..RegionChoice::default() };
    let target = Target::new(&read_surface(Path::new(surface))?, surface, preset, &choice, DVec3::Y, &lens)?;
    let geometry = target.geometry()?;
    let law = Law { background: 1.0, ..Law::default() };
    let around = Surroundings::new(&geometry, target.proxy.sphere, preset == Preset::Object, &law);
    let cameras = |file: &String| -> Result<Vec<Camera>, camsplat::Error> {
        Ok(read_cameras_with_notes(&plan_file(Path::new(file)))?.0)
    };
    let tests = cameras(tests)?;
    let untrained = vec![0.0; tests.len()];
    let runs: Vec<(String, Vec<Camera>, Vec<f64>)> = layouts
        .iter()
        .map(|file| Ok((file.clone(), cameras(file)?, untrained.clone())))
        .collect::<Result<_, camsplat::Error>>()?;
    let seen = Observations::new(surface, &geometry, around, &tests, &runs);
    let views: Vec<u32> = seen.layouts.iter().map(|layout| layout.views).collect();
    let text = serde_json::json!({ "ends": seen.ends, "beside": seen.beside, "views": views, "shown": seen.shown });
    fs::write(format!("{out}.json"), text.to_string())?;
    let near = seen.layouts.iter().flat_map(|layout| layout.near.iter().flatten());
    fs::write(format!("{out}.f32"), near.flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>())?;
    Ok(())
}
