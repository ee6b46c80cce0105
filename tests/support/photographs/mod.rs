//! Small scenes whose photographs are known, and photographs of them.
#![allow(dead_code, reason = "each test binary uses a part")]

use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;

use super::device::context;
use camsplat::lab::path_tracer::assembly::Assembly;
use camsplat::lab::path_tracer::tracer::{Exposure, Photograph, Strategy, Tracer};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::model::{Environment, Face, Material, Model, Vertex};
use glam::{DVec3, Vec2, Vec3, Vec4};

/// A white Lambert surface, that reflects nothing else.
pub fn lambert(colour: f32) -> Material {
    let base = Vec4::new(colour, colour, colour, 1.0);
    Material { base, metallic: 0.0, specular: 0.0, double_sided: true, ..Material::default() }
}

/// Adds a rectangle around `centre` with the half sides `u` and `v`, whose front is where `u x v` points; texture
/// coordinates run along them from 0 to 1.
pub fn add_quad(model: &mut Model, centre: DVec3, u: DVec3, v: DVec3, material: Material) {
    let first = model.vertices.len() as u32;
    let at = model.materials.len() as u32;
    for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
        let uv = 0.5 * Vec2::new(x as f32 + 1.0, y as f32 + 1.0);
        let position = centre + x * u + y * v;
        model.vertices.push(Vertex { position, uvs: [uv; 2], colour: [255; 4], ..Vertex::default() });
    }
    for corners in [[0, 1, 2], [0, 2, 3]] {
        model.faces.push(Face { corners: corners.map(|c| first + c), material: at });
    }
    model.materials.push(material);
}

/// Adds a ball of flat triangles.
pub fn add_ball(model: &mut Model, centre: DVec3, radius: f64, material: Material) {
    const RINGS: u32 = 24;
    const SECTORS: u32 = 48;
    let first = model.vertices.len() as u32;
    let at = model.materials.len() as u32;
    for ring in 0..=RINGS {
        for sector in 0..SECTORS {
            let (sin, cos) = (PI * f64::from(ring) / f64::from(RINGS)).sin_cos();
            let (y, x) = (TAU * f64::from(sector) / f64::from(SECTORS)).sin_cos();
            let position = centre + radius * DVec3::new(sin * x, cos, -sin * y);
            model.vertices.push(Vertex { position, colour: [255; 4], ..Vertex::default() });
        }
    }
    for ring in 0..RINGS {
        for sector in 0..SECTORS {
            let vertex = |r: u32, s: u32| first + r * SECTORS + s % SECTORS;
            let [a, b, c, d] = [
                vertex(ring, sector),
                vertex(ring + 1, sector),
                vertex(ring + 1, sector + 1),
                vertex(ring, sector + 1),
            ];
            if ring + 1 < RINGS {
                model.faces.push(Face { corners: [a, b, c], material: at });
            }
            if ring > 0 {
                model.faces.push(Face { corners: [a, c, d], material: at });
            }
        }
    }
    model.materials.push(material);
}

/// A ball of radius 1 about the origin.
pub fn ball(material: Material) -> Model {
    let mut model = Model::default();
    add_ball(&mut model, DVec3::ZERO, 1.0, material);
    model
}

/// A camera that looks from one place at another, with square pixels.
pub fn camera(from: DVec3, at: DVec3, size: u32, fov: f64) -> Camera {
    let up = if (at - from).normalize().y.abs() > 0.99 { DVec3::Z } else { DVec3::Y };
    let pose = Pose::looking(from, at - from, up);
    Camera { name: "0000.png".into(), pose, intrinsics: Intrinsics::from_fov(size, size, fov) }
}

/// A photograph by a strategy.
pub fn photograph_by(
    model: &Model,
    environment: Option<&Environment>,
    camera: &Camera,
    samples: u32,
    strategy: Strategy,
) -> Photograph {
    let assembly = Assembly::new(model, environment).expect("a scene with light");
    let pixels = u64::from(camera.intrinsics.width) * u64::from(camera.intrinsics.height);
    let tracer = Tracer::with(&context(), assembly, pixels, strategy, false).expect("room for it");
    let exposure = Exposure { samples, seed: 1, show_sky: false };
    let taken = tracer.photograph(camera, 0, exposure, || ControlFlow::Continue(())).expect("a photograph");
    assert_eq!(context().messages(), Vec::<String>::new(), "the validation layers found fault");
    taken
}

/// A photograph.
pub fn photograph(model: &Model, environment: Option<&Environment>, camera: &Camera, samples: u32) -> Photograph {
    photograph_by(model, environment, camera, samples, Strategy::Both)
}

/// Mean radiance over the pixels that are all scene.
pub fn mean(photograph: &Photograph) -> Vec3 {
    let inside: Vec<Vec3> =
        photograph.pixels.iter().filter(|p| p[3] == 1.0).map(|p| Vec3::new(p[0], p[1], p[2])).collect();
    assert!(!inside.is_empty(), "the scene is seen");
    inside.iter().sum::<Vec3>() / inside.len() as f32
}
