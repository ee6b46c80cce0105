//! The sample object with materials, for photographs, and a studio around it.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

use super::object_parts;
use super::parts::{Finish, Stuff};
use crate::scene::colour::linear;
use crate::scene::model::{Environment, Face, Material, Model, Vertex};

/// Columns of the studio's map.
const COLUMNS: u32 = 128;

/// [`super::object`] with materials, +Y up as glTF has it: polished metal, glazed and matt parts. Curved parts are smooth.
pub fn object_model() -> Model {
    let parts = object_parts();
    let positions: Vec<DVec3> = parts.mesh.positions.iter().map(|p| DVec3::new(p.x, p.z, -p.y)).collect();
    // Vertices are shared within a sheet only, so edges stay sharp.
    let mut normals = vec![DVec3::ZERO; positions.len()];
    for triangle in &parts.mesh.triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        triangle.iter().for_each(|v| normals[*v as usize] += (b - a).cross(c - a));
    }
    let mut finishes: Vec<Finish> = Vec::new();
    let mut faces = Vec::new();
    for (corners, finish) in parts.mesh.triangles.iter().zip(&parts.finishes) {
        let material = finishes.iter().position(|known| known == finish).unwrap_or_else(|| {
            finishes.push(*finish);
            finishes.len() - 1
        });
        faces.push(Face { corners: *corners, material: material as u32 });
    }
    let vertex = |(position, normal): (&DVec3, &DVec3)| Vertex {
        position: *position,
        normal: normal.normalize_or_zero().as_vec3(),
        colour: [255; 4],
        ..Vertex::default()
    };
    Model {
        vertices: positions.iter().zip(&normals).map(vertex).collect(),
        faces,
        materials: finishes.iter().map(material).collect(),
        ..Model::default()
    }
}

fn material(finish: &Finish) -> Material {
    let base = Vec3::from(finish.colour.map(|v| linear(v) as f32)).extend(1.0);
    let matt = Material { base, metallic: 0.0, ..Material::default() };
    match finish.stuff {
        Stuff::Matt => matt,
        Stuff::Glazed => Material { roughness: 0.6, clearcoat: 1.0, clearcoat_roughness: 0.08, ..matt },
        Stuff::Metal => Material { metallic: 1.0, roughness: 0.15, ..matt },
    }
}

/// A studio of grey walls with a pale floor: a large lamp overhead, two panels at the sides, and a band of light below eye level,
/// so that nothing lies in the dark.
pub fn studio() -> Environment {
    let (width, height) = (COLUMNS, COLUMNS / 2);
    let light = |i: u32| {
        let polar = PI * (f64::from(i / width) + 0.5) / f64::from(height);
        let around = TAU * ((f64::from(i % width) + 0.5) / f64::from(width) - 0.5);
        let direction = DVec3::new(polar.sin() * around.cos(), polar.cos(), polar.sin() * around.sin());
        let within = |towards: DVec3, radius: f64| direction.angle_between(towards) < radius;
        let up = (0.5 + 0.5 * direction.y) as f32;
        let walls = Vec3::new(0.34, 0.33, 0.31).lerp(Vec3::new(0.40, 0.44, 0.50), up);
        match () {
            () if within(DVec3::new(0.3, 1.0, 0.2), 0.5) => Vec3::new(3.6, 3.5, 3.3),
            () if within(DVec3::new(-1.0, 0.25, 0.5), 0.35) => Vec3::new(3.0, 2.4, 1.7),
            () if within(DVec3::new(0.7, 0.1, -0.9), 0.3) => Vec3::new(1.6, 2.2, 3.0),
            () => walls,
        }
    };
    Environment { width, height, radiance: (0..width * height).map(light).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, the demo's photographs would show other things than its plans are of, or nothing that shines.
    #[test]
    fn the_model_is_the_object_with_materials() {
        let (model, parts) = (object_model(), object_parts());
        assert_eq!((model.vertices.len(), model.faces.len()), (parts.mesh.positions.len(), parts.mesh.triangles.len()));
        for (face, finish) in model.faces.iter().zip(&parts.finishes) {
            let material = &model.materials[face.material as usize];
            assert_eq!(material.metallic > 0.0, finish.stuff == Stuff::Metal);
            let [a, b, c] = face.corners.map(|v| &model.vertices[v as usize]);
            let normal = (b.position - a.position).cross(c.position - a.position).as_vec3();
            assert!([a, b, c].iter().all(|corner| corner.normal.dot(normal) > 0.0), "a normal looks inward");
        }
        let scored = |score: f32| parts.finishes.iter().any(|finish| finish.score == score);
        assert!(scored(2.0) && model.materials.iter().any(|material| material.clearcoat > 0.0));
        let highest = model.vertices.iter().map(|vertex| vertex.position.y).fold(f64::MIN, f64::max);
        let top = parts.mesh.positions.iter().map(|p| p.z).fold(f64::MIN, f64::max);
        assert_eq!(highest, top);
    }
}
