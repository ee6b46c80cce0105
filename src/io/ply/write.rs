//! PLY files that camsplat writes: binary little-endian, positions as float.

use glam::DVec3;

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

/// Bytes of a file of oriented points: x y z, red green blue, nx ny nz and radius. Points without a colour are mid grey,
/// those without a normal or radius have a zero one.
pub fn oriented(points: &Points) -> Vec<u8> {
    let more = ["nx", "ny", "nz", "radius"].map(|name| format!("property float {name}\n")).concat();
    let mut bytes = header(points.positions.len(), &more);
    bytes.extend(b"end_header\n");
    for (i, &position) in points.positions.iter().enumerate() {
        vertex(&mut bytes, position, points.colours.get(i).copied().unwrap_or([128; 3]));
        let normal = points.normals.get(i).copied().unwrap_or(DVec3::ZERO).as_vec3();
        let radius = points.radii.get(i).copied().unwrap_or(0.0);
        normal.extend(radius).to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
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

    /// If this failed, a proxy from photos would lose its normals, radii or colours on the way to a plan.
    #[test]
    fn oriented_points_survive_a_round_trip() {
        let written = Points {
            positions: vec![DVec3::new(0.5, -1.0, 2.0), DVec3::ZERO],
            normals: vec![DVec3::Z, DVec3::NEG_X],
            radii: vec![0.25, 0.5],
            colours: vec![[1, 2, 3], [250, 128, 0]],
            oriented: true,
            ..Points::default()
        };
        assert_eq!(read(&oriented(&written)), Surface::Points(written));
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
