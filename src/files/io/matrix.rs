//! Camera-to-world matrices, as several formats hold them.

use std::path::Path;

use glam::{DMat3, DQuat, DVec3};

use crate::error::{Error, Result};
use crate::scene::camera::Pose;

/// Axes of a camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Axes {
    /// X right, Y down, Z forward.
    OpenCv,
    /// X right, Y up, -Z forward.
    OpenGl,
}

/// The world-from-camera pose of a camera-to-world matrix, of three rows or four; its axes may have any one length.
///
/// # Errors
/// What is wrong with it, as a continuation of its name.
pub(crate) fn pose(rows: &[[f64; 4]], axes: Axes) -> Result<Pose, String> {
    if rows.iter().flatten().any(|value| !value.is_finite()) {
        return Err("has a value that is no finite number".into());
    }
    let last_is_sound = rows.len() == 3 || rows.len() == 4 && rows[3] == [0.0, 0.0, 0.0, 1.0];
    if !last_is_sound {
        return Err("must have the rows of a 4x4 pose, the last one 0 0 0 1".into());
    }
    let column = |c: usize| DVec3::new(rows[0][c], rows[1][c], rows[2][c]);
    let [x, y, z] = [0, 1, 2].map(|c| column(c).normalize_or_zero());
    let turned = match axes {
        Axes::OpenCv => DMat3::from_cols(x, y, z),
        Axes::OpenGl => DMat3::from_cols(x, -y, -z),
    };
    // Matrices are often printed with few digits; a shear or a mirror is far from this.
    let skew = x.dot(y).abs().max(y.dot(z).abs()).max(z.dot(x).abs());
    if !(skew < 1e-2 && turned.determinant() > 0.9) {
        return Err("is no rotation; its first three columns must be right-handed unit axes".into());
    }
    Ok(Pose { position: column(3), rotation: DQuat::from_mat3(&turned).normalize() })
}

/// The numbers of each line of a text file that is not blank, with the number of the line from 1.
///
/// # Errors
/// Where a word is no number.
pub(crate) fn lines(path: &Path, bytes: &[u8]) -> Result<Vec<(usize, Vec<f64>)>> {
    let text = String::from_utf8_lossy(bytes);
    let mut lines = Vec::new();
    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
        let parse = |word: &str| {
            let what = || format!("line {number}: {word:?} is no number; export the file again");
            word.parse().map_err(|_| Error::input(path, what()))
        };
        lines.push((number, line.split_ascii_whitespace().map(parse).collect::<Result<_>>()?));
    }
    Ok(lines)
}

/// Rows of four numbers; none where a line has another number of them.
pub(crate) fn rows(lines: &[(usize, Vec<f64>)]) -> Option<Vec<[f64; 4]>> {
    lines.iter().map(|(_, numbers)| numbers.as_slice().try_into().ok()).collect()
}
