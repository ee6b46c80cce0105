//! Scratch: features of pixels from JSON on stdin.
use std::io::{Read, Write};
use camsplat::io::read_surface;
use camsplat::metrics::score_point::view;
use camsplat::plan::config::Preset;
use camsplat::plan::job::{RegionChoice, Target};
use camsplat::quality::look::{Caster, Viewer, lift};
use camsplat::quality::nearest::nearest;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::region::Shape;
use camsplat::visibility::device_scene::SceneGeometry;
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

#[derive(serde::Deserialize)]
struct In { scene: String, corners: Option<[f64; 6]>, k: [f64; 6], tests: Vec<[[f64; 4]; 4]>, px: Vec<[f64; 2]>, pv: Vec<usize>, runs: Vec<Vec<[[f64; 4]; 4]>>, #[serde(default)] background: bool }
fn pose(m: &[[f64; 4]; 4]) -> Pose {
    let c = |i: usize, s: f64| s * DVec3::new(m[0][i], m[1][i], m[2][i]);
    Pose { position: c(3, 1.0), rotation: DQuat::from_mat3(&DMat3::from_cols(c(0, 1.0), c(1, -1.0), c(2, -1.0))).normalize() }
}
fn main() {
    let mut text = String::new();
    std::io::stdin().read_to_string(&mut text).unwrap();
    let input: In = serde_json::from_str(&text).unwrap();
    let [fx, fy, cx, cy, w, h] = input.k;
    let intrinsics = Intrinsics { width: w as u32, height: h as u32, focal: [fx, fy], principal: [cx, cy] };
    let shape = input.corners.map(|c| Shape::Box { min: DVec3::new(c[0], c[1], c[2]), max: DVec3::new(c[3], c[4], c[5]) });
    let preset = if shape.is_some() { Preset::Room } else { Preset::Object };
    let target = Target::new(&read_surface(input.scene.as_ref()).unwrap(), &input.scene, preset, &RegionChoice { shape, ..Default::default() }, DVec3::Y, &intrinsics).unwrap();
    let geometry = SceneGeometry::new(&target.proxy, &target.region).unwrap();
    let l = lift(&geometry, target.proxy.sphere.1);
    let caster = Caster::new(&geometry, l);
    let camera = |m| Camera { name: String::new(), pose: pose(m), intrinsics };
    let tests: Vec<Viewer> = input.tests.iter().map(|m| Viewer::new(&camera(m), &geometry)).collect();
    let runs: Vec<Vec<_>> = input.runs.iter().map(|r| r.iter().map(|m| view(&geometry, &camera(m))).collect()).collect();
    let rows: Vec<Vec<f32>> = (0..input.px.len()).into_par_iter().map(|i| {
        let [y, x] = input.px[i];
        let look = caster.look(input.pv[i] as u32, &tests[input.pv[i]], [((x + 0.5) / w) as f32, ((y + 0.5) / h) as f32]);
        let mut look = look;
        let surface = look.distance > 0.0;
        if !surface && input.background {
            let c = geometry.to_internal.point(target.proxy.sphere.0).as_vec3();
            let t = &tests[input.pv[i]];
            let o = glam::Vec3::from(t.position);
            let (u, v) = (((x + 0.5) / w) as f32, ((y + 0.5) / h) as f32);
            let dir = (glam::Vec3::from(t.corner) + u * glam::Vec3::from(t.across) + v * glam::Vec3::from(t.along)).normalize();
            let along = (c - o).dot(dir);
            look.position = (o + along * dir).to_array(); look.direction = (-dir).to_array(); look.distance = along; look.normal = [0.0; 3];
        }
        let viewer_cos = glam::Vec3::from(look.normal).dot(glam::Vec3::from(look.direction));
        let mut row = vec![if surface { look.distance } else { -look.distance }, viewer_cos];
        row.extend(look.position); row.extend(look.direction);
        for views in &runs {
            let mut found = if look.distance > 0.0 { nearest(&geometry.bvh, &look, views, 400) } else { Vec::new() };
            let count = found.len();
            found.truncate(8);
            row.push(count as f32);
            for k in 0..8 { match found.get(k) { Some(n) => row.extend([n.angle, n.ratio, n.cosine]), None => row.extend([9.0, 0.0, 0.0]) } }
        }
        row
    }).collect();
    let mut out = std::io::stdout().lock();
    for row in rows { out.write_all(bytemuck::cast_slice(&row)).unwrap(); }
}
