//! Trained splats as what they are, for rendering and training.

use std::path::Path;

use super::decode::{self, Decoded};
use super::header::Header;
use crate::error::{Error, Result};
use crate::files::io::splats::usable::usable;
use crate::scene::gaussians::{Gaussians, MAX_DEGREE, coefficients};

/// Reads Gaussians from the bytes of a PLY file, of the usual 3DGS layout or packed; `path` is for messages only, `notes`
/// takes what a user should know about what was read. Properties may be in any order, others are left out, and values
/// are as the file has them. Packed opacities of 0 and 1 count as a thousandth away from it. Flat splats (2DGS) have no extent along their
/// third axis. What [`usable`] does not keep is left out and counted.
///
/// # Errors
/// When the file is damaged or cut short, holds no splats or none that can be used, or lacks a property.
pub fn gaussians(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Gaussians> {
    let refuse = |what: String| Err(Error::input(path, what));
    let bytes = &*super::with_line_feeds(bytes);
    let header = Header::parse(path, bytes)?;
    let Some(vertices) = header.element("vertex") else {
        return refuse("the file has no element \"vertex\"; give a .ply file of trained splats".into());
    };
    let of_harmonics = header.element(if decode::is_packed(&header) { "sh" } else { "vertex" });
    let rest = of_harmonics.map_or(0, |e| e.properties.iter().filter(|p| p.name.starts_with("f_rest_")).count());
    if vertices.count == 0 {
        return refuse("the file holds no splats; give one that was trained to the end".into());
    }
    let decoded = Decoded::read(path, bytes, &header)?;
    let whole = |degree: &u32| 3 * (coefficients(*degree) - 1) == rest && decoded.rest.len() == rest;
    let degree = (0..=MAX_DEGREE).find(whole).unwrap_or_else(|| {
        notes.push(format!(
            "{rest} properties f_rest_* are no whole degree of harmonics, which have 0, 9, 24 or 45: colours are the same from all sides"
        ));
        0
    });
    if decoded.flat {
        notes.push("flat splats (2DGS: there is no property scale_2) are drawn as Gaussians without thickness".into());
    }
    let mut gaussians = in_single_precision(decoded, degree);
    gaussians.antialiased = header.antialiased;
    let gaussians = usable(path, gaussians, notes)?;
    let layout = if decode::is_packed(&header) { ", packed: values are rounded" } else { "" };
    notes.push(format!("{} splats with harmonics of degree {degree}{layout}", gaussians.len()));
    Ok(gaussians)
}

fn in_single_precision(decoded: Decoded, degree: u32) -> Gaussians {
    let each = coefficients(degree);
    let mut harmonics = vec![0.0; 3 * each * decoded.centres.len()];
    for (values, constant) in harmonics.chunks_exact_mut(3 * each).zip(&decoded.constants) {
        values[..3].copy_from_slice(&constant.as_vec3().to_array());
    }
    // Columns are dropped one by one: those of large files take much memory.
    for (k, column) in decoded.rest.into_iter().take(3 * (each - 1)).enumerate() {
        let (channel, above) = (k / (each - 1), k % (each - 1));
        for (values, value) in harmonics.chunks_exact_mut(3 * each).zip(column) {
            values[3 * (above + 1) + channel] = value as f32;
        }
    }
    Gaussians {
        centres: decoded.centres,
        log_scales: decoded.log_scales.into_iter().map(|s| s.as_vec3().to_array()).collect(),
        rotations: decoded.rotations.into_iter().map(|q| q.map(|v| v as f32)).collect(),
        opacities: decoded.opacities.into_iter().map(|o| o as f32).collect(),
        degree,
        harmonics,
        antialiased: false,
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::super::write;
    use super::*;
    use crate::scene::gaussians::FLAT;

    fn read(bytes: &[u8]) -> Result<Gaussians> {
        gaussians(Path::new("a.ply"), bytes, &mut Vec::new())
    }

    fn refusal(bytes: &[u8]) -> String {
        read(bytes).unwrap_err().to_string()
    }

    /// Three splats with values that are all different and exact in single precision.
    fn three(degree: u32) -> Gaussians {
        let value = |i: usize, k: usize| (i * 100 + k) as f32 / 8.0 - 7.0;
        Gaussians {
            centres: (0..3).map(|i| DVec3::new(i as f64, 0.5, -2.25)).collect(),
            log_scales: (0..3).map(|i| [0, 1, 2].map(|k| value(i, k))).collect(),
            rotations: (0..3).map(|i| [3, 4, 5, 6].map(|k| value(i, k))).collect(),
            opacities: (0..3).map(|i| value(i, 7)).collect(),
            degree,
            harmonics: (0..3).flat_map(|i| (0..3 * coefficients(degree)).map(move |k| value(i, 8 + k))).collect(),
            antialiased: degree == 2,
        }
    }

    /// If this failed, what was trained would come back as something else.
    #[test]
    fn splats_survive_a_round_trip() {
        for degree in 0..=MAX_DEGREE {
            let splats = three(degree);
            assert_eq!(read(&write::gaussians(&splats)).unwrap(), splats, "degree {degree}");
        }
    }

    /// The layout that other programs expect, byte by byte: if this failed, they would show other colours or nothing.
    #[test]
    fn files_have_the_usual_layout() {
        let splats = three(1);
        let bytes = write::gaussians(&splats);
        let end = b"end_header\n";
        let start = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let header = String::from_utf8(bytes[..start].to_vec()).unwrap();
        let names: Vec<&str> = header.lines().filter_map(|line| line.strip_prefix("property float ")).collect();
        let rest: Vec<String> = (0..9).map(|k| format!("f_rest_{k}")).collect();
        let expected = format!(
            "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 {} opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3",
            rest.join(" ")
        );
        assert_eq!(names.join(" "), expected);
        assert_eq!(bytes.len() - start, 3 * 4 * 26);
        let second: Vec<f32> = bytes[start + 104..start + 208]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        let h = &splats.harmonics[12..24];
        let by_channel = [h[3], h[6], h[9], h[4], h[7], h[10], h[5], h[8], h[11]];
        let mut row = vec![1.0, 0.5, -2.25, 0.0, 0.0, 0.0, h[0], h[1], h[2]];
        row.extend(by_channel);
        row.push(splats.opacities[1]);
        row.extend(splats.log_scales[1].iter().chain(&splats.rotations[1]));
        assert_eq!(second, row);
    }

    /// One splat of degree 0 with properties in another order, one of them unknown.
    const ORDER: &str = "rot_3 rot_2 rot_1 rot_0 opacity z y x state f_dc_2 f_dc_1 f_dc_0 scale_2 scale_1 scale_0";
    const ROW: [f32; 15] = [4.0, 3.0, 2.0, 1.0, -0.5, 30.0, 20.0, 10.0, 99.0, 0.75, 0.5, 0.25, -3.0, -2.0, -1.0];

    fn header(format: &str, names: &str, count: usize) -> String {
        let properties: String = names.split(' ').map(|n| format!("property float {n}\n")).collect();
        format!("ply\nformat {format} 1.0\nelement vertex {count}\n{properties}end_header\n")
    }

    /// If this failed, files of other programs would be read wrongly just because of their layout.
    #[test]
    fn any_encoding_and_order_is_read_the_same() {
        let expected = Gaussians {
            centres: vec![DVec3::new(10.0, 20.0, 30.0)],
            log_scales: vec![[-1.0, -2.0, -3.0]],
            rotations: vec![[1.0, 2.0, 3.0, 4.0]],
            opacities: vec![-0.5],
            degree: 0,
            harmonics: vec![0.25, 0.5, 0.75],
            antialiased: false,
        };
        let text = ROW.map(|v| v.to_string()).join(" ");
        let ascii = format!("{}{text}\n", header("ascii", ORDER, 1)).into_bytes();
        let mut little = header("binary_little_endian", ORDER, 1).into_bytes();
        ROW.iter().for_each(|v| little.extend(v.to_le_bytes()));
        let mut big = header("binary_big_endian", ORDER, 1).into_bytes();
        ROW.iter().for_each(|v| big.extend(v.to_be_bytes()));
        for bytes in [ascii, little, big] {
            assert_eq!(read(&bytes).unwrap(), expected);
        }
    }

    fn ascii(names: &str, rows: &[&[f32]]) -> Vec<u8> {
        let text: String =
            rows.iter().map(|row| row.iter().map(|v| v.to_string()).collect::<Vec<_>>().join(" ") + "\n").collect();
        (header("ascii", names, rows.len()) + &text).into_bytes()
    }

    /// If this failed, a file that is no set of Gaussians would be rendered as one, or be refused without a remedy.
    #[test]
    fn files_that_are_no_gaussians_are_refused() {
        let with = |more: &[&str]| {
            let names = [&[ORDER], more].concat().join(" ");
            ascii(&names, &[&[&ROW[..], &vec![0.0; more.len()]].concat()])
        };
        assert!(read(&with(&[])).is_ok());
        let lacking = refusal(&ascii(&ORDER.replace("rot_2", "a").replace("opacity", "b"), &[&ROW]));
        assert!(lacking.contains("has no property opacity, rot_2,"), "{lacking}");
        assert!(refusal(&ascii(ORDER, &[])).contains("holds no splats"));
        assert!(refusal(b"ply\nformat ascii 1.0\nend_header\n").contains("no element \"vertex\""));
        let points = refusal(&ascii("x y z", &[&[0.0; 3]]));
        assert!(points.contains("has no property f_dc_0, f_dc_1, f_dc_2, opacity"), "{points}");
        let whole = write::gaussians(&three(2));
        assert!(refusal(&whole[..whole.len() - 1]).contains("cut short"));
    }

    /// If this failed, splats of other trainers would be refused though they can be drawn, or get colours that they do not have.
    #[test]
    fn what_a_file_lacks_has_its_meaning() {
        let with = |bytes: &[u8]| {
            let mut notes = Vec::new();
            (gaussians(Path::new("a.ply"), bytes, &mut notes).unwrap(), notes)
        };
        let more = |names: &[&str]| {
            let row = [&ROW[..], &vec![0.0; names.len()]].concat();
            with(&ascii(&[&[ORDER], names].concat().join(" "), &[&row]))
        };
        let nine = [
            "f_rest_0", "f_rest_1", "f_rest_2", "f_rest_3", "f_rest_9", "f_rest_5", "f_rest_6", "f_rest_7", "f_rest_8",
        ];
        for names in [&nine[..2], &nine] {
            let (splats, notes) = more(names);
            assert!(splats.degree == 0 && notes[0].contains("are no whole degree of harmonics"), "{notes:?}");
        }
        let (flat, notes) = with(&ascii(&ORDER.replace("scale_2", "a"), &[&ROW]));
        assert!(flat.log_scales[0] == [-1.0, -2.0, FLAT] && notes[0].contains("flat splats (2DGS"), "{notes:?}");
        let coloured = ORDER.replace("f_dc_0", "red").replace("f_dc_1", "green").replace("f_dc_2", "blue");
        let (coloured, _) = with(&ascii(&coloured, &[&ROW]));
        for (value, colour) in coloured.harmonics.iter().zip([0.25, 0.5, 0.75]) {
            assert!((0.5 + 0.282_094_79 * value - colour).abs() < 1e-6, "{coloured:?}");
        }
    }

    /// Two splats of the packed layout, with `sh` bytes for each.
    fn packed(sh: &[[u8; 9]]) -> Vec<u8> {
        let bounds = ["x", "y", "z", "scale_x", "scale_y", "scale_z", "r", "g", "b"];
        let floats: String =
            bounds.iter().map(|b| format!("property float min_{b}\nproperty float max_{b}\n")).collect();
        let words = ["position", "rotation", "scale", "color"].map(|n| format!("property uint packed_{n}\n")).concat();
        let rest: String = (0..9).map(|k| format!("property uchar f_rest_{k}\n")).collect();
        let mut bytes = format!(
            "ply\nformat binary_little_endian 1.0\nelement chunk 1\n{floats}element vertex 2\n{words}element sh {}\n\
             {rest}end_header\n",
            sh.len()
        )
        .into_bytes();
        let spans = [
            [-1.0f32, 1.0],
            [0.0, 2.0],
            [5.0, 6.0],
            [-6.0, -2.0],
            [-5.0, -1.0],
            [-4.0, 0.0],
            [0.0, 1.0],
            [0.0, 1.0],
            [0.0, 1.0],
        ];
        spans.iter().flatten().for_each(|v| bytes.extend(v.to_le_bytes()));
        // All at their ends: x and z highest, y lowest; the largest component left out is z; red 1, green 0, blue 1.
        let ends = 0x7ffu32 << 21 | 0x7ff;
        for (rotation, colour) in [(3u32 << 30 | 0x1ff << 20, 0xff00_ff80u32), (0, 0xff00_ff00)] {
            [ends, rotation, ends, colour].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        }
        sh.iter().for_each(|row| bytes.extend(row));
        bytes
    }

    /// If this failed, packed files would be rendered with other shapes or colours than they were packed from.
    #[test]
    fn packed_files_are_unpacked() {
        let splats = read(&packed(&[[0, 128, 255, 127, 128, 128, 128, 128, 1], [128; 9]])).unwrap();
        assert_eq!(splats.centres[0], DVec3::new(1.0, 0.0, 6.0));
        assert_eq!(splats.log_scales[0], [-2.0, -5.0, 0.0]);
        let [w, x, y, z] = splats.rotations[0];
        // The word has 0x1ff of 0x3ff for w, all but nothing, and the least for x and y.
        let least = -0.5f32.sqrt();
        assert!(
            w.abs() < 1e-3 && (x - least).abs() < 1e-6 && (y - least).abs() < 1e-6 && z.abs() < 0.04,
            "{w} {x} {y} {z}"
        );
        assert!((splats.opacities[0] - (128.0f32 / 127.0).ln()).abs() < 1e-6);
        assert!(splats.opacities[1].is_finite() && splats.opacities[1] < -6.0);
        assert_eq!(splats.degree, 1);
        let h = &splats.harmonics[..12];
        let one = 0.5 / 0.282_094_79;
        assert!((h[0] - one).abs() < 1e-5 && (h[1] + one).abs() < 1e-5 && (h[2] - one).abs() < 1e-5, "{h:?}");
        // By channel in the file; the lowest, the step above the middle, the highest; then the step below it for green.
        assert_eq!([h[3], h[6], h[9], h[4]], [-4.0, 1.0 / 64.0, 4.0, -1.0 / 64.0]);
        assert_eq!(h[11], 8.0 * (1.5 / 256.0 - 0.5));
        assert!(refusal(&packed(&[[128; 9]])).contains("2 splats have 1 rows of the element \"sh\""));
    }
}
