//! PLY: points, meshes and trained splats, as ascii or binary of either byte order.

mod decode;
mod elements;
mod gaussians;
mod header;
mod packed;
pub mod write;

use std::borrow::Cow;
use std::path::Path;

use glam::DVec3;

use self::elements::Columns;
pub use self::gaussians::gaussians;
use self::header::{Header, Kind};
pub use self::packed::packed;
use super::splats::surface;
use crate::error::{Error, Result};
use crate::scene::surface::{Mesh, Points, Surface};
use crate::scene::{colour, polygon};

/// Reads a surface from the bytes of a PLY file; `path` is for messages only, `notes` takes what a user should know
/// about what was read.
///
/// A file with a `face` element is a mesh; one with the properties of a trained or packed splat is read by [`gaussians`];
/// the rest is points. Known properties of `vertex`: x y z, nx ny nz (normals of any length, zero where unknown),
/// red green blue (8 bits, 16 bits, or floats in [0, 1], all sRGB), and vds or score (view dependency in [1, 2]); for points
/// also radius. Frame and units are the file's.
///
/// # Errors
/// When the file is damaged or cut short, lacks positions, or fails the checks that all surfaces pass.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Surface> {
    let bytes = &*with_line_feeds(bytes);
    let header = Header::parse(path, bytes)?;
    let surface = if decode::is_splats(&header) {
        surface::points(path, &gaussians(path, bytes, notes)?, notes)?
    } else {
        plain(path, bytes, &header, notes)?
    };
    super::checks::surface(path, surface, notes)
}

/// The file with line feeds where it is text whose lines end as on an old Macintosh.
fn with_line_feeds(bytes: &[u8]) -> Cow<'_, [u8]> {
    let old = bytes.starts_with(b"ply\r") && bytes.get(4) != Some(&b'\n');
    match old && bytes.windows(12).take(1000).any(|window| window == b"format ascii") {
        true => bytes.iter().map(|byte| if *byte == b'\r' { b'\n' } else { *byte }).collect::<Vec<u8>>().into(),
        false => bytes.into(),
    }
}

/// Points or a mesh.
fn plain(path: &Path, bytes: &[u8], header: &Header, notes: &mut Vec<String>) -> Result<Surface> {
    let faces = header.element("face").filter(|face| face.count > 0);
    if faces.is_none()
        && let Some(strips) = header.element("tristrips")
        && strips.count > 0
    {
        return Err(Error::input(path, "its triangles are stored as \"tristrips\"; export it with plain faces"));
    }
    let mut columns = elements::read(path, bytes, header, |element, property| match element {
        "vertex" => !property.starts_with("f_rest_"),
        "face" => matches!(property, "vertex_indices" | "vertex_index"),
        _ => false,
    })?;
    let positions = positions(path, &mut columns)?;
    let colours = colours(header, &mut columns);
    let scores = columns.scalars("vertex", "vds").or_else(|| columns.scalars("vertex", "score")).unwrap_or_default();
    let scores = scores.into_iter().map(|s| s as f32).collect();
    if faces.is_none() {
        let normals = normals(&mut columns);
        let oriented = !normals.is_empty();
        let radii = columns.scalars("vertex", "radius").unwrap_or_default().into_iter().map(|r| r as f32).collect();
        return Ok(Surface::Points(Points {
            positions,
            normals,
            radii,
            colours,
            scores,
            oriented,
            ..Points::default()
        }));
    }
    let triangles = triangles(path, &mut columns, &positions, notes)?;
    let colours = match colours[..] {
        [] => Vec::new(),
        _ => triangles.iter().map(|t| colour::mean(t.map(|v| colours[v as usize]))).collect(),
    };
    Ok(Surface::Mesh(Mesh { positions, triangles, colours, scores }))
}

/// The properties x, y and z of all vertices.
fn positions(path: &Path, columns: &mut Columns) -> Result<Vec<DVec3>> {
    vectors(columns, ["x", "y", "z"]).ok_or_else(|| {
        Error::input(path, "the element \"vertex\" has no properties x, y and z; export it with vertex positions")
    })
}

/// Three properties of all vertices as vectors, where all three are there.
fn vectors(columns: &mut Columns, names: [&str; 3]) -> Option<Vec<DVec3>> {
    let [x, y, z] = names.map(|name| columns.scalars("vertex", name));
    let (x, y, z) = (x?, y?, z?);
    Some(x.into_iter().zip(y).zip(z).map(|((x, y), z)| DVec3::new(x, y, z)).collect())
}

/// Unit normals, zero where a file gives none for a point; empty where it gives none at all.
fn normals(columns: &mut Columns) -> Vec<DVec3> {
    let normals = vectors(columns, ["nx", "ny", "nz"]).unwrap_or_default();
    let unit: Vec<DVec3> = normals.into_iter().map(|n| n.normalize_or_zero()).collect();
    if unit.iter().all(|n| *n == DVec3::ZERO) { Vec::new() } else { unit }
}

/// 8-bit sRGB colours of the vertices; empty where there are none.
fn colours(header: &Header, columns: &mut Columns) -> Vec<[u8; 3]> {
    for names in [["red", "green", "blue"], ["r", "g", "b"], ["diffuse_red", "diffuse_green", "diffuse_blue"]] {
        let full = full(header.kind("vertex", names[0]));
        if let Some(colours) = vectors(columns, names) {
            return colours.into_iter().map(|c| colour::bytes(c / full)).collect();
        }
    }
    Vec::new()
}

/// The value of a full colour of that type.
fn full(kind: Option<Kind>) -> f64 {
    match kind {
        Some(Kind::F32 | Kind::F64) => 1.0,
        Some(Kind::U16) => 65535.0,
        _ => 255.0,
    }
}

/// The faces as triangles.
fn triangles(
    path: &Path,
    columns: &mut Columns,
    positions: &[DVec3],
    notes: &mut Vec<String>,
) -> Result<Vec<[u32; 3]>> {
    let vertices = positions.len();
    let faces = columns.lists("face", "vertex_indices").or_else(|| columns.lists("face", "vertex_index"));
    let Some(faces) = faces else {
        let what = "the element \"face\" has no list vertex_indices; export it with faces as vertex index lists";
        return Err(Error::input(path, what));
    };
    let mut triangles = Vec::with_capacity(faces.len());
    let (mut short, mut polygons) = (0, 0);
    for (f, face) in faces.iter().enumerate() {
        if let Some(&outside) = face.iter().find(|&&v| !(v >= 0.0 && v < vertices as f64 && v.fract() == 0.0)) {
            return Err(Error::input(
                path,
                format!("face {f} refers to vertex {outside} and there are only {vertices}; export the mesh again"),
            ));
        }
        match face.len() {
            0..=2 => short += 1,
            3 => {}
            _ => polygons += 1,
        }
        let corners: Vec<DVec3> = face.iter().map(|v| positions[*v as usize]).collect();
        triangles.extend(polygon::triangles(&corners).into_iter().map(|of| of.map(|i| face[i] as u32)));
    }
    if polygons > 0 {
        notes.push(format!("{polygons} of {} faces were cut into triangles", faces.len()));
    }
    if short > 0 {
        notes.push(format!("{short} of {} faces have fewer than three vertices and were skipped", faces.len()));
    }
    Ok(triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<Surface> {
        parse(Path::new("a.ply"), bytes, &mut Vec::new())
    }

    /// A quad and its byte-swapped and ascii twins, with colours, scores and an unknown property.
    fn quad(format: &str) -> Vec<u8> {
        let mut bytes = format!(
            "ply\nformat {format} 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty double y\n\
             property short z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float vds\n\
             element face 1\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n"
        )
        .into_bytes();
        for (i, (x, y)) in [(0, 0), (1, 0), (1, 1), (0, 1)].into_iter().enumerate() {
            let (z, red, vds) = (-2i16, 10 * i as u8, 1.25f32);
            match format {
                "ascii" => bytes.extend(format!("{x} {y}.0 {z} {red} 0 255 {vds}\r\n").bytes()),
                "binary_little_endian" => {
                    bytes.extend((x as f32).to_le_bytes());
                    bytes.extend(f64::from(y).to_le_bytes());
                    bytes.extend(z.to_le_bytes());
                    bytes.extend([red, 0, 255]);
                    bytes.extend(vds.to_le_bytes());
                }
                _ => {
                    bytes.extend((x as f32).to_be_bytes());
                    bytes.extend(f64::from(y).to_be_bytes());
                    bytes.extend(z.to_be_bytes());
                    bytes.extend([red, 0, 255]);
                    bytes.extend(vds.to_be_bytes());
                }
            }
        }
        match format {
            "ascii" => bytes.extend(b"7 4 0 1 2 3\n"),
            "binary_little_endian" => {
                bytes.extend([7, 4]);
                (0..4i32).for_each(|v| bytes.extend(v.to_le_bytes()));
            }
            _ => {
                bytes.extend([7, 4]);
                (0..4i32).for_each(|v| bytes.extend(v.to_be_bytes()));
            }
        }
        bytes
    }

    /// If this failed, one of the three encodings, a scalar type or the cutting of polygons would be read wrongly.
    #[test]
    fn the_three_encodings_of_a_mesh_agree() {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let Surface::Mesh(mesh) = read(&quad(format)).unwrap() else { panic!("{format}: not a mesh") };
            assert_eq!(mesh.positions[2], DVec3::new(1.0, 1.0, -2.0), "{format}");
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]], "{format}");
            assert_eq!(mesh.colours, [[10, 0, 255], [17, 0, 255]], "{format}");
            assert_eq!(mesh.scores, [1.25; 4], "{format}");
        }
    }

    /// If this failed, a truncated file could be read as a smaller one, or panic.
    #[test]
    fn no_prefix_of_a_file_is_accepted() {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            let whole = quad(format);
            // The last two bytes of the ascii file are a digit and its newline.
            for end in 0..whole.len() - 2 {
                assert!(read(&whole[..end]).is_err(), "{format}: {end} of {} bytes were accepted", whole.len());
            }
        }
    }

    /// If this failed, a user could not find the one bad number in a file of millions.
    #[test]
    fn errors_name_the_place() {
        let ascii = |rows: &str| {
            let head =
                "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n";
            read(format!("{head}end_header\n{rows}").as_bytes()).unwrap_err().to_string()
        };
        assert!(ascii("0 0 0\n1 abc 0\n").contains("vertex 1, property \"y\""), "{}", ascii("0 0 0\n1 abc 0\n"));
        assert!(ascii("0 0 0\n1 nan 0\n").contains("only one point"));
        let mut mesh = quad("binary_little_endian");
        let end = mesh.len();
        mesh[end - 4] = 9;
        assert!(read(&mesh).unwrap_err().to_string().contains("face 0 refers to vertex 9"));
        assert!(read(b"").unwrap_err().to_string().contains("empty"));
    }

    /// If this failed, points would lose their normals, or normals of no length would become NaN.
    #[test]
    fn normals_are_made_unit_and_may_be_zero() {
        let text = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n\
                    property float nx\nproperty float ny\nproperty float nz\nend_header\n0 0 0 0 0 2\n1 0 0 0 0 0\n";
        let Surface::Points(points) = read(text.as_bytes()).unwrap() else { panic!("not points") };
        assert!(points.oriented);
        assert_eq!(points.normals, [DVec3::Z, DVec3::ZERO]);
    }
}
