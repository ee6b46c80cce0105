use glam::{DQuat, DVec3};

use super::*;
use crate::scene::gaussians::{MAX_DEGREE, coefficients};

/// Splats of a coloured cloud, all different, with a flat one and an opaque one.
fn cloud(count: usize, degree: u32) -> Gaussians {
    let value = |i: usize, k: usize| ((i * 31 + k * 7) as f64 * 0.618).sin();
    let mut gaussians = Gaussians {
        centres: (0..count).map(|i| 3.0 * DVec3::new(value(i, 0), value(i, 1), value(i, 2))).collect(),
        log_scales: (0..count).map(|i| [3, 4, 5].map(|k| (-3.0 + value(i, k)) as f32)).collect(),
        rotations: (0..count).map(|i| [6, 7, 8, 9].map(|k| value(i, k) as f32)).collect(),
        opacities: (0..count).map(|i| 2.0 * value(i, 10) as f32).collect(),
        degree,
        harmonics: (0..count)
            .flat_map(|i| (0..3 * coefficients(degree)).map(move |k| 0.4 * value(i, 11 + k) as f32))
            .collect(),
        antialiased: true,
    };
    gaussians.log_scales[1][2] = -40.0;
    gaussians.opacities[2] = 20.0;
    gaussians
}

fn parsed(name: &str, bytes: &[u8]) -> Result<Gaussians> {
    parse(Path::new(name), bytes, &mut Vec::new())
}

/// The greatest differences of two models whose splats are in any order: of centres, axes of the covariance, opacities, colours, other
/// harmonics. The nearest centres belong together.
fn differences(a: &Gaussians, b: &Gaussians) -> [f64; 5] {
    assert_eq!((a.len(), a.degree), (b.len(), b.degree));
    let covariance = |g: &Gaussians, i: usize| {
        let [w, x, y, z] = g.rotations[i].map(f64::from);
        let turn = glam::DMat3::from_quat(DQuat::from_xyzw(x, y, z, w).normalize());
        let size = glam::DMat3::from_diagonal(DVec3::from(g.log_scales[i].map(|s| f64::from(s).exp())));
        (turn * size) * (turn * size).transpose()
    };
    let mut worst = [0.0; 5];
    for i in 0..a.len() {
        let j = (0..b.len())
            .min_by(|j, k| a.centres[i].distance(b.centres[*j]).total_cmp(&a.centres[i].distance(b.centres[*k])))
            .unwrap();
        let spread = covariance(a, i);
        let size = spread.to_cols_array().iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let off = (spread - covariance(b, j)).to_cols_array().iter().fold(0.0f64, |m, v| m.max(v.abs())) / size;
        let each = 3 * a.coefficients();
        let harmonics = |from: usize, to: usize| {
            let pairs =
                a.harmonics[each * i + from..each * i + to].iter().zip(&b.harmonics[each * j + from..each * j + to]);
            pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
        };
        let found = [
            a.centres[i].distance(b.centres[j]),
            off,
            (a.opacity(i) - b.opacity(j)).abs(),
            harmonics(0, 3),
            harmonics(3, each),
        ];
        worst = [0, 1, 2, 3, 4].map(|k| found[k].max(worst[k]));
    }
    worst
}

/// If this failed, what a viewer shows would be another model than was trained.
#[test]
fn every_format_gives_back_the_model() {
    // Of centres, shapes, opacities, colours and other harmonics: what eight bits and the steps of each format leave.
    let bounds = [
        (SplatFormat::Ply, [1e-6, 1e-6, 1e-6, 1e-6, 1e-6]),
        (SplatFormat::Glb, [1e-6, 1e-5, 1e-6, 1e-6, 1e-6]),
        (SplatFormat::Packed, [6e-3, 0.02, 3e-3, 0.02, 0.02]),
        (SplatFormat::Spz, [1e-6, 0.1, 3e-3, 0.02, 0.07]),
        (SplatFormat::Spz4, [1e-6, 0.1, 3e-3, 0.02, 0.07]),
        (SplatFormat::Sog, [2e-4, 0.05, 3e-3, 0.02, 0.02]),
        (SplatFormat::Splat, [1e-6, 0.06, 3e-3, 0.02, 0.0]),
    ];
    for (format, bounds) in bounds {
        for degree in 0..=MAX_DEGREE {
            let model = cloud(300, degree);
            let mut notes = Vec::new();
            let bytes = write(&model, format, &mut notes).unwrap();
            let name = format!("a.{}", format.extension());
            let back = parsed(&name, &bytes).unwrap();
            let expected = match format {
                SplatFormat::Splat => {
                    let own = model.harmonics.chunks_exact(3 * coefficients(degree)).flat_map(|own| &own[..3]);
                    Gaussians { harmonics: own.copied().collect(), degree: 0, ..model.clone() }
                }
                _ => model,
            };
            let found = differences(&expected, &back);
            assert!(
                found.iter().zip(bounds).all(|(found, bound)| *found <= bound),
                "{format:?}, degree {degree}: {found:?}"
            );
            let silent = matches!(format, SplatFormat::Splat | SplatFormat::Glb);
            assert!(back.antialiased != silent && notes.is_empty() != silent, "{format:?}: {notes:?}");
        }
    }
}

/// If this failed, files of a viewer would be taken for something else, or a name say another format than the file has.
#[test]
fn formats_go_by_names_and_by_what_a_file_begins_with() {
    for format in [
        SplatFormat::Ply,
        SplatFormat::Packed,
        SplatFormat::Splat,
        SplatFormat::Spz,
        SplatFormat::Sog,
        SplatFormat::Glb,
    ] {
        let name = format!("dir/Model.{}", format.extension().to_uppercase());
        assert_eq!(SplatFormat::of(Path::new(&name)).unwrap(), format);
        let bytes = write(&cloud(9, 1), format, &mut Vec::new()).unwrap();
        // Only `.splat` has nothing to be known by.
        let other = if format == SplatFormat::Splat { "a.splat" } else { "a.ply" };
        assert_eq!(parsed(other, &bytes).unwrap().len(), 9, "{format:?}");
        let is_ply = matches!(format, SplatFormat::Ply | SplatFormat::Packed);
        assert_eq!(is_splats(Path::new(other), &bytes), !is_ply, "{format:?}");
    }
    assert!(SplatFormat::of(Path::new("a.obj")).unwrap_err().to_string().contains(".ply, .compressed.ply"));
    assert!(parsed("a.txt", b"hello").unwrap_err().to_string().contains("no file of splats"));
    assert!(parsed("a.splat", &[0; 33]).unwrap_err().to_string().contains("33 bytes are no whole number"));
}

/// If this failed, a damaged file would end the program, or give splats that nobody trained.
#[test]
fn damaged_files_are_refused() {
    for format in [SplatFormat::Spz, SplatFormat::Spz4, SplatFormat::Sog, SplatFormat::Glb, SplatFormat::Packed] {
        let name = format!("a.{}", format.extension());
        let bytes = write(&cloud(20, 2), format, &mut Vec::new()).unwrap();
        for length in (0..bytes.len()).step_by(7) {
            assert!(parsed(&name, &bytes[..length]).is_err(), "{format:?}: {length} of {} bytes", bytes.len());
        }
        // Whatever a changed byte makes of it, it is no panic, and splats that can be drawn.
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x55;
            if let Ok(read) = parsed(&name, &changed) {
                assert!((0..read.len()).all(|i| read.is_finite(i)), "{format:?}: byte {at}");
            }
        }
    }
}

/// If this failed, a small file could make a reader take all memory.
#[test]
fn what_a_header_announces_is_not_set_aside() {
    let bytes = spz::write(&cloud(3, 0), 4);
    for (at, what) in [(8, "announces"), (32, "stream 0")] {
        let mut large = bytes.clone();
        large[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(parsed("a.spz", &large).unwrap_err().to_string().contains(what), "byte {at}");
    }
}

/// If this failed, glTF files in which a node turns the model would show it elsewhere, or with colours that did not turn with it.
#[test]
fn a_node_s_place_counts() {
    let model = cloud(12, 3);
    let bytes = gltf::write_splats(&model).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let text = String::from_utf8(bytes[20..20 + length].to_vec()).unwrap();
    let turned = text.trim_end().replace(
        r#""nodes":[{"mesh":0}]"#,
        r#""nodes":[{"mesh":0,"rotation":[0.5,0.5,0.5,0.5],"scale":[2,2,2],"translation":[1,0,0]}]"#,
    );
    assert_ne!(turned, text.trim_end());
    let mut padded = turned.into_bytes();
    padded.resize(padded.len().next_multiple_of(4), b' ');
    let mut file = bytes[..8].to_vec();
    let rest = &bytes[20 + length..];
    file.extend(((12 + 8 + padded.len() + rest.len()) as u32).to_le_bytes());
    file.extend((padded.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(&padded);
    file.extend(rest);
    let read = parsed("a.glb", &file).unwrap();
    // x to y to z to x, twice as large, one further.
    for i in 0..model.len() {
        let c = model.centres[i];
        assert!(read.centres[i].distance(2.0 * DVec3::new(c.z, c.x, c.y) + DVec3::X) < 1e-5);
        let grown = f64::from(read.log_scales[i][0] - model.log_scales[i][0]);
        assert!((grown - 2f64.ln()).abs() < 1e-5, "{grown}");
        // Seen from where the node brings the viewer, the colour is the same.
        let w = DVec3::new(0.48, -0.6, 0.64);
        let colour = |g: &Gaussians, w: DVec3| {
            let basis = crate::scene::harmonics::above_constant(w);
            (0..15).map(|k| basis[k] * f64::from(g.harmonics[48 * i + 3 * (k + 1)])).sum::<f64>()
        };
        let (a, b) = (colour(&model, w), colour(&read, DVec3::new(w.z, w.x, w.y)));
        assert!((a - b).abs() < 1e-5, "{a} and {b}");
    }
    let uneven = String::from_utf8(padded).unwrap().replace("[2,2,2]", "[2,1,2]");
    let mut file2 = file[..20].to_vec();
    file2.extend(uneven.as_bytes());
    file2.extend(rest);
    assert!(parsed("a.glb", &file2).unwrap_err().to_string().contains("stretches it unevenly"));
}
