//! PLY files that camsplat writes: binary little-endian, positions as float.

use glam::DVec3;

use crate::scene::gaussians::Gaussians;
use crate::scene::surface::Points;

/// Bytes of a file of coloured points: x y z, red green blue (8-bit sRGB) and, where given, one more float property.
/// Points without a colour are mid grey; `colours` and the property's values go by point.
pub fn points(positions: &[DVec3], colours: &[[u8; 3]], property: Option<(&str, &[f32])>) -> Vec<u8> {
    let declaration = property.map_or(String::new(), |(name, _)| format!("property float {name}\n"));
    let mut bytes = header(positions.len(), &declaration);
    bytes.extend(b"end_header\n");
    for (i, &position) in positions.iter().enumerate() {
        vertex(&mut bytes, position, colours.get(i).copied().unwrap_or([128; 3]));
        if let Some((_, values)) = property {
            bytes.extend(values.get(i).copied().unwrap_or(f32::NAN).to_le_bytes());
        }
    }
    bytes
}

/// Bytes of a file of points with all that is known of them: x y z, red green blue, and where there are any nx ny nz, radius and
/// vds. Every attribute of `surface` must be empty or as long as its positions.
pub(crate) fn surface_points(surface: &Points) -> Vec<u8> {
    let Points { positions, normals, radii, colours, scores, .. } = surface;
    let mut names: Vec<&str> = Vec::new();
    let mut declare = |there: bool, given: &[&'static str]| {
        if there {
            names.extend(given);
        }
    };
    declare(!normals.is_empty(), &["nx", "ny", "nz"]);
    declare(!radii.is_empty(), &["radius"]);
    declare(!scores.is_empty(), &["vds"]);
    let declarations: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let mut bytes = header(positions.len(), &declarations);
    bytes.extend(b"end_header\n");
    for (i, &position) in positions.iter().enumerate() {
        vertex(&mut bytes, position, colours.get(i).copied().unwrap_or([128; 3]));
        let normal = normals.get(i).map(|n| n.as_vec3().to_array());
        let values = normal.iter().flatten().chain(radii.get(i)).chain(scores.get(i));
        values.for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}

/// Bytes of a file of triangles with a colour (8-bit sRGB) for each vertex; `triangles` index into `vertices`.
pub fn mesh(vertices: &[(DVec3, [u8; 3])], triangles: &[[u32; 3]]) -> Vec<u8> {
    let mut bytes = header(vertices.len(), "");
    bytes.extend(format!("element face {}\nproperty list uchar int vertex_indices\n", triangles.len()).bytes());
    bytes.extend(b"end_header\n");
    for &(position, colour) in vertices {
        vertex(&mut bytes, position, colour);
    }
    for triangle in triangles {
        bytes.push(3);
        triangle.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}

/// Bytes of a file of trained splats in the usual 3DGS layout, which other programs read: x y z, nx ny nz (zero), f_dc_0 to
/// f_dc_2, f_rest_0 and on (all of red first; none at degree 0), opacity, scale_0 to scale_2, rot_0 to rot_3, all float.
pub fn gaussians(gaussians: &Gaussians) -> Vec<u8> {
    let each = gaussians.coefficients();
    let rest: Vec<String> = (0..3 * (each - 1)).map(|k| format!("f_rest_{k}")).collect();
    let first = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2".split(' ');
    let last = "opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split(' ');
    let names = first.chain(rest.iter().map(String::as_str)).chain(last);
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    let count = gaussians.len();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by camsplat\nelement vertex {count}\n\
         {properties}end_header\n"
    )
    .into_bytes();
    for i in 0..count {
        let harmonics = &gaussians.harmonics[3 * each * i..3 * each * (i + 1)];
        let mut put = |values: &[f32]| values.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        put(&gaussians.centres[i].as_vec3().to_array());
        put(&[0.0; 3]);
        put(&harmonics[..3]);
        for channel in 0..3 {
            (1..each).for_each(|k| put(&[harmonics[3 * k + channel]]));
        }
        put(&[gaussians.opacities[i]]);
        put(&gaussians.log_scales[i]);
        put(&gaussians.rotations[i]);
    }
    bytes
}

/// The header up to and with the element `vertex`.
fn header(vertices: usize, more: &str) -> Vec<u8> {
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by camsplat\nelement vertex {vertices}\n\
         property float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n{more}"
    )
    .into_bytes()
}

/// Appends a position and a colour.
fn vertex(bytes: &mut Vec<u8>, position: DVec3, colour: [u8; 3]) {
    position.as_vec3().to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    bytes.extend(colour);
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::surface::Surface;

    fn read(bytes: &[u8]) -> Surface {
        super::super::parse(Path::new("a.ply"), bytes, &mut Vec::new()).unwrap()
    }

    /// If this failed, exported points would not be what was planned for, or their value would be lost.
    #[test]
    fn points_survive_a_round_trip() {
        let positions = vec![DVec3::new(0.5, -1.0, 2.0), DVec3::ZERO];
        let colours = vec![[1, 2, 3], [250, 128, 0]];
        let Surface::Points(points) = read(&points(&positions, &colours, Some(("score", &[1.0, 1.5])))) else {
            panic!("not points")
        };
        assert_eq!((points.positions, points.colours, points.scores), (positions, colours, vec![1.0, 1.5]));
    }

    /// If this failed, what photos reveal about a surface would not reach the plan that is made from the file.
    #[test]
    fn all_that_is_known_of_points_survives_a_round_trip() {
        let surface = Points {
            positions: vec![DVec3::new(0.5, -1.0, 2.0), DVec3::ZERO],
            normals: vec![DVec3::Z, DVec3::NEG_X],
            radii: vec![0.25, 0.5],
            colours: vec![[1, 2, 3], [250, 128, 0]],
            scores: vec![1.0, 1.5],
            oriented: true,
            ..Points::default()
        };
        let Surface::Points(back) = read(&surface_points(&surface)) else { panic!("not points") };
        assert_eq!(back, surface);
        let plain = Points { positions: surface.positions, colours: surface.colours, ..Points::default() };
        let Surface::Points(back) = read(&surface_points(&plain)) else { panic!("not points") };
        assert_eq!(back, plain);
    }

    /// If this failed, exported meshes would have wrong faces in a viewer.
    #[test]
    fn meshes_survive_a_round_trip() {
        let vertices = [(DVec3::ZERO, [30; 3]), (DVec3::X, [60; 3]), (DVec3::Y, [90; 3])];
        let Surface::Mesh(mesh) = read(&mesh(&vertices, &[[0, 1, 2], [2, 1, 0]])) else { panic!("not a mesh") };
        assert_eq!(mesh.positions, [DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 0]]);
        assert_eq!(mesh.colours, [[60; 3]; 2]);
    }
}
