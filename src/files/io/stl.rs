//! STL: triangles, binary or ascii. Corners at the same place are one vertex; normals and attributes are left out.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;

use super::binary::Cursor;
use super::checks;
use crate::error::{Error, Result};
use crate::scene::surface::{Mesh, Surface};

/// Bytes before the first triangle of a binary file, and of each triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// Reads a surface from the bytes of an STL file; `path` is for messages only. Frame and units are the file's.
///
/// # Errors
/// When the file is cut short, holds something else, or fails the checks that all surfaces pass.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Surface> {
    let mut corners = Corners::default();
    match is_binary(bytes) {
        true => binary(path, bytes, &mut corners)?,
        false => ascii(path, bytes, &mut corners)?,
    }
    checks::surface(path, Surface::Mesh(corners.mesh), notes)
}

/// Whether the length is that of the count in the header: binary files may begin with `solid` too.
fn is_binary(bytes: &[u8]) -> bool {
    let count = bytes.get(80..HEADER).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    let whole = count.is_some_and(|count| bytes.len() as u64 >= HEADER as u64 + TRIANGLE as u64 * u64::from(count));
    whole && !(bytes.starts_with(b"solid") && bytes[..bytes.len().min(1000)].windows(5).any(|word| word == b"facet"))
        || !bytes.starts_with(b"solid")
}

fn binary(path: &Path, bytes: &[u8], corners: &mut Corners) -> Result<()> {
    let mut cursor = Cursor::new(path, bytes, 80);
    let count = cursor.u32("the number of triangles")?;
    for i in 0..count {
        let triangle = cursor.array::<TRIANGLE>(format_args!("triangle {i} of {count}"))?;
        // A normal of three numbers comes first.
        let value = |k: usize| f64::from(f32::from_le_bytes([0, 1, 2, 3].map(|b| triangle[12 + 4 * k + b])));
        (0..3).for_each(|c| corners.add(DVec3::new(value(3 * c), value(3 * c + 1), value(3 * c + 2))));
    }
    Ok(())
}

fn ascii(path: &Path, bytes: &[u8], corners: &mut Corners) -> Result<()> {
    let text = String::from_utf8_lossy(bytes);
    let mut in_facet = 0;
    for (number, line) in (1..).zip(text.lines()) {
        let refuse = |what: &str| Error::input(path, format!("line {number}: {what}; export the file again"));
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("vertex") => {
                let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
                let &[x, y, z] = &numbers[..] else { return Err(refuse("a vertex has three numbers")) };
                corners.add(DVec3::new(x, y, z));
                in_facet += 1;
            }
            Some("endfacet") if in_facet != 3 => return Err(refuse("a facet has three vertices")),
            Some("endfacet") => in_facet = 0,
            _ => {}
        }
    }
    match in_facet {
        0 => Ok(()),
        _ => Err(Error::input(path, "the file is cut short within a facet; copy or export it again")),
    }
}

/// Triangles from their corners, one after another.
#[derive(Default)]
struct Corners {
    mesh: Mesh,
    known: HashMap<[u64; 3], u32>,
    open: Vec<u32>,
}

impl Corners {
    fn add(&mut self, corner: DVec3) {
        let next = self.mesh.positions.len() as u32;
        // Both zeros are one place.
        let vertex = *self.known.entry((corner + 0.0).to_array().map(f64::to_bits)).or_insert(next);
        if vertex == next {
            self.mesh.positions.push(corner);
        }
        self.open.push(vertex);
        if let [a, b, c] = self.open[..] {
            self.mesh.triangles.push([a, b, c]);
            self.open.clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.5]];
    const FACES: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    fn binary_file(title: &[u8]) -> Vec<u8> {
        let mut bytes = title.to_vec();
        bytes.resize(80, b' ');
        bytes.extend((FACES.len() as u32).to_le_bytes());
        for face in FACES {
            bytes.extend([0; 12]);
            bytes.extend(face.iter().flat_map(|v| CORNERS[*v]).flat_map(f32::to_le_bytes));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn ascii_file() -> String {
        let facet = |face: &[usize; 3]| {
            let vertex =
                |v: &usize| format!("      vertex {} {} {:e}\n", CORNERS[*v][0], CORNERS[*v][1], CORNERS[*v][2]);
            let vertices: String = face.iter().map(vertex).collect();
            format!("  facet normal 0 0 0\n    outer loop\n{vertices}    endloop\n  endfacet\n")
        };
        format!("solid a thing\n{}endsolid a thing\n", FACES.iter().map(facet).collect::<String>())
    }

    fn mesh(bytes: &[u8]) -> Mesh {
        match parse(Path::new("a.stl"), bytes, &mut Vec::new()).unwrap() {
            Surface::Mesh(mesh) => mesh,
            Surface::Points(_) => panic!("points"),
        }
    }

    /// If this failed, one of the encodings would give another surface, or binary files of programs that begin them with `solid` none.
    #[test]
    fn both_encodings_give_the_same_mesh() {
        let found = mesh(ascii_file().as_bytes());
        assert_eq!((found.positions.len(), found.triangles.len()), (4, 4));
        for file in [binary_file(b"solid by another program"), binary_file(b"exported")] {
            assert_eq!(mesh(&file), found);
        }
        let corners =
            |mesh: &Mesh| mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])).collect::<Vec<_>>();
        let expected = FACES.map(|face| face.map(|v| DVec3::from(CORNERS[v].map(f64::from))));
        assert_eq!(corners(&found), expected);
    }

    /// If this failed, a file that was cut short would be planned for as a part of the surface, or end the program.
    #[test]
    fn cut_files_are_refused() {
        let (binary, ascii) = (binary_file(b"x"), ascii_file());
        for length in 0..binary.len() {
            assert!(parse(Path::new("a.stl"), &binary[..length], &mut Vec::new()).is_err(), "{length} bytes");
        }
        let cut = ascii.find("endloop").unwrap();
        for text in [&ascii[..cut], &ascii[..cut].replace("vertex 1", "vertex x"), "solid nothing\nendsolid\n"] {
            assert!(parse(Path::new("a.stl"), text.as_bytes(), &mut Vec::new()).is_err(), "{text}");
        }
    }
}
