//! Wavefront OBJ meshes with the diffuse colours of their materials.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::checks;
use crate::error::{Error, Result, bounded};
use crate::scene::surface::{Mesh, Points, Surface};
use crate::scene::{colour, polygon};

/// Colour of faces without one where others have one: the format's default diffuse colour of 0.8.
const DEFAULT_COLOUR: [u8; 3] = [204; 3];

/// What has been read so far.
#[derive(Default)]
struct Reading {
    positions: Vec<DVec3>,
    /// Colour per vertex where there is any.
    vertex_colours: Vec<Option<[u8; 3]>>,
    triangles: Vec<[u32; 3]>,
    /// Colour of each triangle's material, where it has one.
    triangle_colours: Vec<Option<[u8; 3]>>,
    materials: HashMap<String, [u8; 3]>,
    material: Option<[u8; 3]>,
    polygons: usize,
    /// Faces that were left out, and what is wrong with the first, with its line.
    left_out: usize,
    first_fault: Option<(usize, String)>,
}

/// Reads a mesh from the bytes of an OBJ file; material libraries are looked for beside `path`. Polygons are cut into
/// triangles. A triangle has the diffuse colour (Kd, taken as sRGB) of its material, or else the
/// mean of its vertices' colours (`v x y z r g b` in [0, 1]). A file without faces is read as points. Groups, normals
/// and texture coordinates are not needed. Frame and units are the file's. Faces of fewer than three corners, or with corners that are not
/// there, are left out and counted; lines may go on behind a backslash, and end as on any system.
///
/// # Errors
/// When a vertex cannot be read, with its line, no face is right, or the surface fails the checks that all surfaces pass.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Surface> {
    let mut reading = Reading::default();
    let refuse = |line: usize, what: &str| {
        Err(Error::input(path, format!("line {line}: {what}; mend the line or export the mesh again")))
    };
    let bytes = &*utf8(bytes);
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let end = if bytes.contains(&b'\n') { b'\n' } else { b'\r' };
    let mut begun = String::new();
    for (number, line) in (1..).zip(bytes.split(|&b| b == end)) {
        begun += String::from_utf8_lossy(line).trim();
        if begun.ends_with('\\') {
            begun.pop();
            begun.push(' ');
            continue;
        }
        if let Err(what) = reading.line(path, &begun, number, notes) {
            return refuse(number, &what);
        }
        begun.clear();
    }
    if let Some((line, what)) = &reading.first_fault {
        if reading.triangles.is_empty() {
            return refuse(*line, what);
        }
        notes.push(format!("{} faces were left out; the first, in line {line}: {what}", reading.left_out));
    }
    if reading.polygons > 0 {
        notes.push(format!("{} faces with more than three vertices were cut into triangles", reading.polygons));
    }
    checks::surface(path, reading.surface(), notes)
}

/// A file in UTF-16, as editors of Windows write it, in UTF-8.
fn utf8(bytes: &[u8]) -> Cow<'_, [u8]> {
    let decode = |unit: fn([u8; 2]) -> u16| -> Vec<u8> {
        let units = bytes[2..].chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
        char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect::<String>().into()
    };
    match bytes {
        [0xfe, 0xff, ..] => decode(u16::from_be_bytes).into(),
        [0xff, 0xfe, ..] => decode(u16::from_le_bytes).into(),
        _ => bytes.into(),
    }
}

impl Reading {
    /// Takes in one line.
    fn line(&mut self, path: &Path, line: &str, number: usize, notes: &mut Vec<String>) -> Result<(), String> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match keyword {
            "v" => self.vertex(rest),
            "f" => {
                if let Err(what) = self.face(rest) {
                    self.left_out += 1;
                    self.first_fault.get_or_insert((number, what));
                }
                Ok(())
            }
            "usemtl" => {
                self.material = self.materials.get(rest.trim()).copied();
                Ok(())
            }
            "mtllib" => {
                self.library(path, rest.trim(), notes);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// `x y z`, then nothing, a weight, a colour, or both; a colour may have an alpha.
    fn vertex(&mut self, rest: &str) -> Result<(), String> {
        let mut numbers = [0.0; 8];
        let mut count = 0;
        for word in rest.split_whitespace() {
            let Some(number) = numbers.get_mut(count) else { return Err("a vertex has at most eight numbers".into()) };
            *number = word.parse().map_err(|_| format!("{word:?} is not a number"))?;
            count += 1;
        }
        let [x, y, z, ..] = numbers;
        // Of eight the fourth is the weight, and the last the alpha.
        let [r, g, b] =
            if count == 8 { [numbers[4], numbers[5], numbers[6]] } else { [numbers[3], numbers[4], numbers[5]] };
        if count < 3 {
            return Err(format!("a vertex has three coordinates and here are {count}"));
        }
        self.positions.push(DVec3::new(x, y, z));
        self.vertex_colours.push((count >= 6).then(|| colour::bytes(DVec3::new(r, g, b))));
        Ok(())
    }

    /// Corners as `v`, `v/t`, `v/t/n` or `v//n`, counted from 1, or back from -1.
    fn face(&mut self, rest: &str) -> Result<(), String> {
        let count = self.positions.len();
        let mut corners = Vec::new();
        for word in rest.split_whitespace() {
            let index = word.split('/').next().unwrap_or_default();
            let index: i64 = index.parse().map_err(|_| format!("{word:?} is not the corner of a face"))?;
            let vertex = if index < 0 { index.checked_add(count as i64) } else { index.checked_sub(1) };
            match vertex.and_then(|v| u32::try_from(v).ok()).filter(|&v| (v as usize) < count) {
                Some(vertex) => corners.push(vertex),
                None => return Err(format!("a face refers to vertex {index} and there are {count} up to here")),
            }
        }
        if corners.len() < 3 {
            return Err(format!("a face has three corners or more and here are {}", corners.len()));
        }
        self.polygons += usize::from(corners.len() > 3);
        let places: Vec<DVec3> = corners.iter().map(|corner| self.positions[*corner as usize]).collect();
        for triangle in polygon::triangles(&places) {
            self.triangles.push(triangle.map(|i| corners[i]));
            self.triangle_colours.push(self.material);
        }
        Ok(())
    }

    /// Takes in the materials of a library; where it is missing, only the colours are lost.
    fn library(&mut self, path: &Path, name: &str, notes: &mut Vec<String>) {
        let file = path.parent().map_or_else(|| PathBuf::from(name), |folder| folder.join(name));
        // Only a plain file is opened: a name can lead to a device that never ends.
        match file.is_file().then(|| std::fs::read(&file)) {
            Some(Ok(bytes)) => self.materials.extend(materials(&bytes)),
            _ => {
                let what = format!("the material library {name:?} was not found, so its colours are missing");
                notes.push(bounded(what));
            }
        }
    }

    /// The finished surface.
    fn surface(self) -> Surface {
        let vertex_colours: Vec<[u8; 3]> = match self.vertex_colours.iter().any(Option::is_some) {
            true => self.vertex_colours.iter().map(|c| c.unwrap_or(DEFAULT_COLOUR)).collect(),
            false => Vec::new(),
        };
        if self.triangles.is_empty() {
            return Surface::Points(Points { positions: self.positions, colours: vertex_colours, ..Points::default() });
        }
        let coloured = !vertex_colours.is_empty() || self.triangle_colours.iter().any(Option::is_some);
        let of_vertices = |t: &[u32; 3]| match vertex_colours[..] {
            [] => DEFAULT_COLOUR,
            _ => colour::mean(t.map(|v| vertex_colours[v as usize])),
        };
        let colours = self.triangles.iter().zip(&self.triangle_colours);
        let colours = match coloured {
            true => colours.map(|(t, c)| c.unwrap_or_else(|| of_vertices(t))).collect(),
            false => Vec::new(),
        };
        Surface::Mesh(Mesh { positions: self.positions, triangles: self.triangles, colours, scores: Vec::new() })
    }
}

/// The diffuse colours of a material library by name; invalid lines are skipped.
fn materials(bytes: &[u8]) -> HashMap<String, [u8; 3]> {
    let mut materials = HashMap::new();
    let mut name = None;
    for line in String::from_utf8_lossy(bytes).lines() {
        let (keyword, rest) = line.trim().split_once(char::is_whitespace).unwrap_or_default();
        match keyword {
            "newmtl" => name = Some(rest.trim().to_owned()),
            "Kd" => {
                let numbers: Vec<f64> = rest.split_whitespace().filter_map(|word| word.parse().ok()).collect();
                if let (Some(name), &[r, g, b]) = (&name, &numbers[..]) {
                    materials.insert(name.clone(), colour::bytes(DVec3::new(r, g, b)));
                }
            }
            _ => {}
        }
    }
    materials
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Surface> {
        parse(Path::new("no-such-folder/a.obj"), text.as_bytes(), &mut Vec::new())
    }

    /// If this failed, one way of writing faces, or the materials, would be read wrongly.
    #[test]
    fn a_mesh_by_hand_is_read_as_written() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("my paints.mtl"), "newmtl red\nKd 1 0 0\n\nnewmtl none\nKs 1 1 1\n").unwrap();
        let text = "mtllib my paints.mtl\r\no thing\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n\
                    usemtl red\nf 1/1/1 2//1 3/1 4\nusemtl none\nf -4 -3 -1\n";
        let mut notes = Vec::new();
        let surface = parse(&folder.path().join("a.obj"), text.as_bytes(), &mut notes).unwrap();
        let Surface::Mesh(mesh) = surface else { panic!("not a mesh") };
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [0, 1, 3]]);
        assert_eq!(mesh.colours, [[255, 0, 0], [255, 0, 0], DEFAULT_COLOUR]);
        assert_eq!(notes, ["1 faces with more than three vertices were cut into triangles"]);
    }

    /// If this failed, scans that keep colours at their vertices would come out grey.
    #[test]
    fn vertex_colours_are_averaged() {
        let Surface::Mesh(mesh) = read("v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0.6\nf 1 2 3\n").unwrap() else {
            panic!("not a mesh")
        };
        assert_eq!(mesh.colours, [[255, 0, 51]]);
        assert!(matches!(read("v 0 0 0\nv 1 0 0\n").unwrap(), Surface::Points(_)));
    }

    /// If this failed, a fault could not be found in a file of a million lines.
    #[test]
    fn faults_name_their_line() {
        let message = |text: &str| read(text).unwrap_err().to_string();
        assert!(message("v 0 0 0\nv 1 x 0\n").contains("line 2: \"x\" is not a number"));
        assert!(message("v 0 0 0\nv 1 0 0\nf 1 2 3\n").contains("line 3: a face refers to vertex 3"));
        assert!(message("v 0 0 0\nv 1 0 0\nf 1 2 0\n").contains("vertex 0"));
        assert!(message("v 0 0 0\nv 1 0 0\nf 1 2\n").contains("three corners"));
        assert!(message("v 0 0 0\nv nan 0 0\nv inf 0 0\nf 1 2 3\n").contains("only one point"));
        assert!(message("").contains("no points"));
    }

    /// If this failed, one odd line would refuse a whole mesh, or, as a byte-order mark did, take the first vertex away in silence, so that
    /// every face had other corners.
    #[test]
    fn odd_lines_cost_no_more_than_themselves() {
        let corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
        let whole = format!("{corners}f 1 2 3 4\n");
        let mesh = |text: &str| {
            let mut notes = Vec::new();
            match parse(Path::new("a.obj"), text.as_bytes(), &mut notes) {
                Ok(Surface::Mesh(mesh)) => (mesh.positions, mesh.triangles, notes),
                other => panic!("{text:?}: {other:?}"),
            }
        };
        let (positions, triangles, _) = mesh(&whole);
        for text in [
            format!("\u{feff}{whole}"),
            whole.replace('\n', "\r"),
            whole.replace('\n', "\r\n"),
            format!("{corners}f 1 2 \\\n  3 \\\r\n4\n"),
            whole.replace("v 1 1 0", "v 1 1 0 1.0 0.5 0.5 0.5 1.0"),
        ] {
            let (found, cut, notes) = mesh(&text);
            assert_eq!((&found, &cut, notes.len()), (&positions, &triangles, 1), "{text:?}");
        }
        for bad in ["f 1 2", "f 1 2 9", "f 1 2 x", "f 0 1 2"] {
            let (_, cut, notes) = mesh(&format!("{corners}{bad}\nf 1 2 3 4\n"));
            assert_eq!(cut, triangles, "{bad}");
            assert!(notes[0].starts_with("1 faces were left out; the first, in line 5: "), "{notes:?}");
        }
        let (_, cut, notes) = mesh(&format!("{whole}v nan 0 0\nf 1 2 5\n"));
        assert!(cut == triangles && notes[1].contains("1 of 5 vertices are not finite"), "{notes:?}");
    }
}
