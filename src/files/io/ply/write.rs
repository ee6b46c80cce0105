//! PLY files that camsplat writes: binary little-endian, positions as float, or as double where float would move them.

use glam::DVec3;

use crate::scene::gaussians::Gaussians;
use crate::scene::stray::Reach;
use crate::scene::surface::Points;

/// Bytes of a file of coloured points: x y z, red green blue (8-bit sRGB) and, where given, one more float property.
/// Points without a colour are mid grey; `colours` and the property's values go by point.
pub fn points(positions: &[DVec3], colours: &[[u8; 3]], property: Option<(&str, &[f32])>) -> Vec<u8> {
    let declaration = property.map_or(String::new(), |(name, _)| format!("property float {name}\n"));
    let precision = Precision::of(positions);
    let mut bytes = header(positions.len(), precision, &declaration);
    bytes.extend(b"end_header\n");
    for (i, &position) in positions.iter().enumerate() {
        vertex(&mut bytes, precision, position, colours.get(i).copied().unwrap_or([128; 3]));
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
    let precision = Precision::of(positions);
    let mut bytes = header(positions.len(), precision, &declarations);
    bytes.extend(b"end_header\n");
    for (i, &position) in positions.iter().enumerate() {
        vertex(&mut bytes, precision, position, colours.get(i).copied().unwrap_or([128; 3]));
        let normal = normals.get(i).map(|n| n.as_vec3().to_array());
        let values = normal.iter().flatten().chain(radii.get(i)).chain(scores.get(i));
        values.for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}

/// Bytes of a file of triangles with a colour (8-bit sRGB) for each vertex; `triangles` index into `vertices`.
pub fn mesh(vertices: &[(DVec3, [u8; 3])], triangles: &[[u32; 3]]) -> Vec<u8> {
    let precision = Precision::of(&vertices.iter().map(|(position, _)| *position).collect::<Vec<_>>());
    let mut bytes = header(vertices.len(), precision, "");
    bytes.extend(format!("element face {}\nproperty list uchar int vertex_indices\n", triangles.len()).bytes());
    bytes.extend(b"end_header\n");
    for &(position, colour) in vertices {
        vertex(&mut bytes, precision, position, colour);
    }
    for triangle in triangles {
        bytes.push(3);
        triangle.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}

/// Bytes of a file of trained splats in the usual 3DGS layout, which other programs read: x y z, nx ny nz (zero), f_dc_0 to
/// f_dc_2, f_rest_0 and on (all of red first; none at degree 0), opacity, scale_0 to scale_2, rot_0 to rot_3, all float. Where float
/// would move them, positions are less a whole offset that a comment in the header gives, and that is added on reading. Those that were
/// trained with the 2D filter have a comment that says so.
pub fn gaussians(gaussians: &Gaussians) -> Vec<u8> {
    let each = gaussians.coefficients();
    let rest: Vec<String> = (0..3 * (each - 1)).map(|k| format!("f_rest_{k}")).collect();
    let first = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2".split(' ');
    let last = "opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3".split(' ');
    let names = first.chain(rest.iter().map(String::as_str)).chain(last);
    let properties: String = names.map(|name| format!("property float {name}\n")).collect();
    let count = gaussians.len();
    let (origin, offset) = match Precision::of(&gaussians.centres) {
        Precision::Single => (DVec3::ZERO, String::new()),
        Precision::Double => {
            let origin = Reach::of(&gaussians.centres).centre.round();
            (origin, format!("comment camsplat offset {} {} {}\n", origin.x, origin.y, origin.z))
        }
    };
    let mode = if gaussians.antialiased { "comment SplatRenderMode: mip\n" } else { "" };
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by camsplat\n{mode}{offset}element vertex {count}\n\
         {properties}end_header\n"
    )
    .into_bytes();
    for i in 0..count {
        let harmonics = &gaussians.harmonics[3 * each * i..3 * each * (i + 1)];
        let mut put = |values: &[f32]| values.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        put(&(gaussians.centres[i] - origin).as_vec3().to_array());
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

/// How positions are stored.
#[derive(Clone, Copy, PartialEq)]
enum Precision {
    Single,
    Double,
}

impl Precision {
    /// Single where it suffices, as most programs write it.
    fn of(positions: &[DVec3]) -> Self {
        if Reach::of(positions).needs_double() { Self::Double } else { Self::Single }
    }
}

/// The header up to and with the element `vertex`.
fn header(vertices: usize, precision: Precision, more: &str) -> Vec<u8> {
    let kind = match precision {
        Precision::Single => "float",
        Precision::Double => "double",
    };
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment written by camsplat\nelement vertex {vertices}\n\
         property {kind} x\nproperty {kind} y\nproperty {kind} z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n{more}"
    )
    .into_bytes()
}

/// Appends a position and a colour.
fn vertex(bytes: &mut Vec<u8>, precision: Precision, position: DVec3, colour: [u8; 3]) {
    match precision {
        Precision::Single => position.as_vec3().to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes())),
        Precision::Double => position.to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes())),
    }
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

    /// If this failed, georeferenced surfaces and splats would move by half a metre when they are written.
    #[test]
    fn positions_far_from_the_origin_survive_a_round_trip() {
        let far = DVec3::new(512_345.0, 5_412_345.0, 231.0);
        let positions: Vec<DVec3> = (0..50).map(|i| far + DVec3::new(0.01, 0.3, 0.07) * f64::from(i)).collect();
        let Surface::Points(back) = read(&points(&positions, &[], None)) else { panic!("not points") };
        assert_eq!(back.positions, positions);
        let splats = Gaussians {
            centres: positions.clone(),
            log_scales: vec![[0.0; 3]; 50],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; 50],
            opacities: vec![1.0; 50],
            degree: 0,
            harmonics: vec![0.5; 150],
            antialiased: false,
        };
        let bytes = gaussians(&splats);
        let back = super::super::gaussians(Path::new("a.ply"), &bytes, &mut Vec::new()).unwrap();
        let Surface::Points(discs) = read(&bytes) else { panic!("not points") };
        for centres in [back.centres, discs.positions] {
            assert!(centres.iter().zip(&positions).all(|(a, b)| a.distance(*b) < 1e-6));
        }
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
