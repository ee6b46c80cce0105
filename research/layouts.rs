//! Camera layouts that differ substantially, for measuring how well trained quality is predicted: even, clustered, lopsided,
//! near, far, aimed elsewhere. Each is turned at random, since quality differs by the rotation alone.
//!
//! ```text
//! cargo run --release --example layouts -- SURFACE VIEWS SEED OUT [X0,Y0,Z0,X1,Y1,Z1]
//! ```
//!
//! writes OUT/NAME.json, a transforms.json each, for `camsplat evaluate --methods cameras:OUT/NAME.json`. Around an object the
//! region is the default shell; with six numbers it is that box inside a room.

use std::f64::consts::{PI, TAU};
use std::fs;
use std::path::Path;

use camsplat::files::io::{read_surface, transforms};
use camsplat::planner::plan::config::Preset;
use camsplat::planner::plan::target::{RegionChoice, Target};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::free_space::FreeSpace;
use camsplat::scene::random;
use camsplat::scene::region::Shape;
use glam::{DQuat, DVec3};

/// Random numbers in a fixed order.
struct Draws {
    seed: u64,
    next: u32,
}

impl Draws {
    fn four(&mut self) -> [f64; 4] {
        self.next += 1;
        random::uniforms(self.seed, 0x6c61_796f, self.next)
    }

    fn direction(&mut self) -> DVec3 {
        let [u, v, ..] = self.four();
        random::direction(u, v)
    }

    /// A standard normal vector.
    fn normal(&mut self) -> DVec3 {
        let [a, b, c, d] = self.four();
        let [e, f, ..] = self.four();
        let pair = |u: f64, v: f64| (-2.0 * (1.0 - u).ln()).sqrt() * (TAU * v).cos();
        DVec3::new(pair(a, b), pair(c, d), pair(e, f))
    }

    fn rotation(&mut self) -> DQuat {
        let [a, b, c, _] = self.four();
        random::rotation([a, b, c])
    }

    fn jittered(&mut self, direction: DVec3, degrees: f64) -> DVec3 {
        (direction + (degrees.to_radians() / 2f64.sqrt()) * self.normal()).normalize()
    }
}

fn fibonacci(count: usize) -> Vec<DVec3> {
    let golden = PI * (1.0 + 5f64.sqrt());
    let point = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let (sin, cos) = (golden * i as f64).sin_cos();
        let flat = (1.0 - z * z).sqrt();
        DVec3::new(flat * cos, flat * sin, z)
    };
    (0..count).map(point).collect()
}

/// An eye and what it looks at.
type Look = (DVec3, DVec3);

fn around(centre: DVec3, (near, far): (f64, f64), views: usize, draws: &mut Draws) -> Vec<(&'static str, Vec<Look>)> {
    let middle = 0.5 * (near + far);
    let radius = near / 2.13;
    let at =
        |directions: &[DVec3], r: f64| -> Vec<Look> { directions.iter().map(|d| (centre + r * *d, centre)).collect() };
    let even = |draws: &mut Draws| -> Vec<DVec3> {
        let turn = draws.rotation();
        fibonacci(views).into_iter().map(|d| turn * d).collect()
    };
    // Of a cap about a random axis that is a part of the sphere.
    let cap = |count: usize, share: f64, axis: DVec3| -> Vec<DVec3> {
        let turn = DQuat::from_rotation_arc(DVec3::Z, axis);
        let cap = fibonacci((count as f64 / share).round() as usize).into_iter().take(count);
        cap.map(|d| turn * d).collect()
    };
    let mut all = Vec::new();
    for name in ["even_a", "even_b"] {
        all.push((name, at(&even(draws), middle)));
    }
    for (name, degrees) in [("jitter12", 12.0), ("jitter25", 25.0)] {
        let directions: Vec<DVec3> = even(draws).into_iter().map(|d| draws.jittered(d, degrees)).collect();
        all.push((name, at(&directions, middle)));
    }
    for name in ["scattered_a", "scattered_b"] {
        let directions: Vec<DVec3> = (0..views).map(|_| draws.direction()).collect();
        all.push((name, at(&directions, middle)));
    }
    let axis = draws.direction();
    all.push(("half", at(&cap(views, 0.5, axis), middle)));
    all.push(("half_up", at(&cap(views, 0.5, DVec3::Y), middle)));
    for (name, share) in [("lean70", 0.7), ("lean85", 0.85)] {
        let axis = draws.direction();
        let most = (share * views as f64).round() as usize;
        let mut directions = cap(most, 0.5, axis);
        directions.extend(cap(views - most, 0.5, -axis));
        all.push((name, at(&directions, middle)));
    }
    for (name, clusters) in [("clusters3", 3), ("clusters5", 5), ("clusters8", 8)] {
        let centres: Vec<DVec3> = (0..clusters).map(|_| draws.direction()).collect();
        let directions: Vec<DVec3> = (0..views).map(|i| draws.jittered(centres[i % clusters], 12.0)).collect();
        all.push((name, at(&directions, middle)));
    }
    let turn = draws.rotation();
    let squeezed = |keep: &dyn Fn(f64) -> f64| -> Vec<DVec3> {
        let point = |d: DVec3| {
            let z = keep(d.z);
            let flat = (1.0 - z * z).max(0.0).sqrt() / (1.0 - d.z * d.z).max(1e-12).sqrt();
            turn * DVec3::new(flat * d.x, flat * d.y, z)
        };
        fibonacci(views).into_iter().map(point).collect()
    };
    all.push(("band", at(&squeezed(&|z| 0.35 * z), middle)));
    all.push(("caps", at(&squeezed(&|z: f64| z.signum() * (0.7 + 0.3 * z.abs())), middle)));
    for (name, r) in [("near", near), ("far", far), ("nearer", 0.5 * far), ("farther", 1.5 * far)] {
        all.push((name, at(&even(draws), r)));
    }
    let directions = even(draws);
    let mixed = directions.iter().map(|d| (centre + far * (0.5 + 0.7 * draws.four()[0]) * *d, centre)).collect();
    all.push(("mixed", mixed));
    let (directions, axis) = (even(draws), draws.direction());
    let halves = directions.iter().map(|d| (centre + if d.dot(axis) > 0.0 { 0.6 * far } else { far } * *d, centre));
    all.push(("halves", halves.collect()));
    for (name, off) in [("aim25", 0.25), ("aim50", 0.5)] {
        let directions = even(draws);
        let aimed =
            directions.iter().map(|d| (centre + middle * *d, centre + off * radius / 3f64.sqrt() * draws.normal()));
        all.push((name, aimed.collect()));
    }
    all
}

fn inside(space: &FreeSpace, views: usize, draws: &mut Draws) -> Vec<(&'static str, Vec<Look>)> {
    let (low, high) = space.region.bounds();
    let (centre, up) = (0.5 * (low + high), space.region.up);
    let seed = u64::from(draws.next) ^ draws.seed;
    let place = |i: usize| space.sample(seed, 7, i as u32);
    let level = |d: DVec3| (d - d.dot(up) * up).normalize_or(DVec3::X);
    let mut all = Vec::new();
    // A grid at eye height, four directions each.
    let eye = low.dot(up) + 0.6 * (high - low).dot(up);
    let stands = views.div_ceil(4);
    let extent = high - low;
    let (wide, deep) = (extent.x.max(1e-9), extent.z.max(1e-9));
    let columns = ((stands as f64 * wide / deep).sqrt().round() as usize).clamp(1, stands);
    let rows = stands.div_ceil(columns);
    let grid = (0..views).map(|i| {
        let (stand, turn) = (i / 4, i % 4);
        let (column, row) = (stand % columns, stand / columns);
        let mut p =
            low + extent * DVec3::new((column as f64 + 0.5) / columns as f64, 0.0, (row as f64 + 0.5) / rows as f64);
        p += (eye - p.dot(up)) * up;
        let angle = TAU * (turn as f64 / 4.0 + 0.125);
        let p = space.project(p);
        (p, p + DVec3::new(angle.cos(), 0.0, angle.sin()))
    });
    all.push(("grid", grid.collect::<Vec<Look>>()));
    let walk = (0..views).map(|i| {
        let p = place(i);
        let p = space.project(p + (eye - p.dot(up)) * up);
        (p, p + level(draws.direction()))
    });
    all.push(("walk", walk.collect()));
    let axis = if extent.x > extent.z { DVec3::X } else { DVec3::Z };
    let side: Vec<DVec3> = (0..50 * views).map(place).filter(|p| (*p - centre).dot(axis) < 0.0).take(views).collect();
    all.push(("one_end", side.into_iter().map(|p| (p, p + draws.direction())).collect()));
    let facing = draws.direction();
    let one_way = (0..views).map(|i| {
        let (p, d) = (place(i), draws.direction());
        (p, p + if d.dot(facing) < 0.0 { -d } else { d })
    });
    all.push(("one_way", one_way.collect()));
    let middle = fibonacci(views).into_iter().enumerate().map(|(i, d)| {
        let p = space.project(centre + 0.15 * (place(i) - centre));
        (p, p + d)
    });
    all.push(("middle", middle.collect()));
    let inward = (0..views).map(|i| (place(i), centre + 0.2 * extent.length() * draws.normal() / 3f64.sqrt()));
    all.push(("inward", inward.collect()));
    for name in ["scattered_a", "scattered_b"] {
        let seed = seed ^ (1 + all.len() as u64);
        let anywhere = (0..views).map(|i| {
            let p = space.sample(seed, 7, i as u32);
            (p, p + draws.direction())
        });
        all.push((name, anywhere.collect()));
    }
    // Places far from one another, and directions that are even over all of them.
    let candidates: Vec<DVec3> = (0..20 * views).map(place).collect();
    let mut gap: Vec<f64> = vec![f64::INFINITY; candidates.len()];
    let turn = draws.rotation();
    let spread = fibonacci(views).into_iter().map(|d| {
        let at = (0..gap.len()).max_by(|a, b| gap[*a].total_cmp(&gap[*b])).unwrap_or(0);
        let p = candidates[at];
        gap.iter_mut().zip(&candidates).for_each(|(gap, other)| *gap = gap.min(p.distance(*other)));
        (p, p + turn * d)
    });
    all.push(("spread", spread.collect()));
    // From where they stand through the middle's surroundings to the other side.
    let across = (0..views).map(|i| {
        let p = place(i);
        let aside = 0.25 * extent * draws.normal() / 3f64.sqrt();
        (p, p + (centre + aside - p).normalize_or(DVec3::X) + 0.3 * draws.normal())
    });
    all.push(("across", across.collect()));
    all
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [surface, views, seed, out, rest @ ..] = &arguments[..] else {
        return Err("give SURFACE VIEWS SEED OUT [X0,Y0,Z0,X1,Y1,Z1]".into());
    };
    let views: usize = views.parse()?;
    let mut draws = Draws { seed: seed.parse()?, next: (views as u32) << 16 };
    let intrinsics = Intrinsics::from_fov(256, 256, 50f64.to_radians());
    let corners: Vec<f64> = rest.first().map_or(Ok(Vec::new()), |text| text.split(',').map(str::parse).collect())?;
    let shape = match corners[..] {
        [x0, y0, z0, x1, y1, z1] => Some(Shape::Box { min: DVec3::new(x0, y0, z0), max: DVec3::new(x1, y1, z1) }),
        _ => None,
    };
    let preset = if shape.is_some() { Preset::Room } else { Preset::Object };
    let choice = RegionChoice { shape, ..RegionChoice::default() };
    let target = Target::new(&read_surface(Path::new(surface))?, surface, preset, &choice, DVec3::Y, &intrinsics)?;
    let layouts = match target.region.shape {
        Shape::Shell { centre, r_min, r_max } => around(centre, (r_min, r_max), views, &mut draws),
        Shape::Box { .. } => inside(&FreeSpace::new(&target.proxy.occluder, &target.region, 96)?, views, &mut draws),
    };
    fs::create_dir_all(out)?;
    for (name, looks) in layouts {
        let cameras = looks.iter().enumerate().map(|(i, (eye, at))| Camera {
            name: format!("{i:04}"),
            pose: Pose::looking(*eye, *at - *eye, target.region.up),
            intrinsics,
        });
        let cameras: Vec<Camera> = cameras.collect();
        assert_eq!(cameras.len(), views, "{name}");
        fs::write(Path::new(out).join(format!("{name}.json")), transforms::write(&cameras, None))?;
    }
    Ok(())
}
