//! Splats that can be drawn.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::io::checks;
use crate::files::io::left_out::LeftOut;
use crate::scene::gaussians::Gaussians;

/// The splats with finite values and a rotation that has a length, after [`Gaussians::bounded`]: opacities of 0 or 1 and axes without extent
/// are sound though their logits and logarithms are infinite. A note counts the others.
///
/// # Errors
/// Where none is left.
pub(in crate::files::io) fn usable(path: &Path, gaussians: Gaussians, notes: &mut Vec<String>) -> Result<Gaussians> {
    let gaussians = gaussians.bounded();
    let mut left_out = LeftOut::default();
    let keep: Vec<bool> = (0..gaussians.len())
        .map(|i| match fault(&gaussians, i) {
            Some(what) => {
                left_out.add(format!("number {i} has {what}"));
                false
            }
            None => true,
        })
        .collect();
    if left_out.is_empty() {
        return Ok(gaussians);
    }
    let kept = gaussians.filtered(|i| keep[i]);
    if let Some(what) = left_out.first().filter(|_| kept.is_empty()) {
        return Err(Error::input(path, format!("none of its splats can be drawn: {what}; train the model again")));
    }
    left_out.note("splats", notes);
    Ok(kept)
}

/// What is wrong with a splat.
fn fault(gaussians: &Gaussians, i: usize) -> Option<&'static str> {
    let each = 3 * gaussians.coefficients();
    let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
    if !checks::usable(gaussians.centres[i]) {
        Some("a position that is not finite")
    } else if !gaussians.opacities[i].is_finite() {
        Some("an opacity that is no number")
    } else if !finite(&gaussians.log_scales[i]) {
        Some("a scale that is not finite")
    } else if !finite(&gaussians.rotations[i]) {
        Some("a rotation that is not finite")
    } else if gaussians.rotations[i].iter().all(|v| v.abs() <= 1e-12) {
        // Squares of components as small as this vanish in single precision.
        Some("a rotation of no length")
    } else if !finite(&gaussians.harmonics[each * i..each * (i + 1)]) {
        Some("a colour that is not finite")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::gaussians::{FLAT, MAX_LOGIT};

    fn three() -> Gaussians {
        Gaussians {
            centres: (0..3).map(|i| DVec3::splat(f64::from(i))).collect(),
            log_scales: vec![[-1.0; 3]; 3],
            rotations: vec![[1.0, 0.0, 0.0, 0.0]; 3],
            opacities: vec![0.0, 1.0, 2.0],
            degree: 1,
            harmonics: vec![0.5; 36],
            antialiased: true,
        }
    }

    /// If this failed, one bad splat would turn pictures or a whole training into NaN, or lose a model of millions.
    #[test]
    fn a_broken_splat_is_left_out_and_named() {
        type Spoil<'a> = &'a dyn Fn(&mut Gaussians);
        let cases: [(Spoil, &str); 7] = [
            (&|s| s.centres[1].y = f64::NAN, "number 1 has a position that is not finite"),
            (&|s| s.opacities[1] = f32::NAN, "number 1 has an opacity that is no number"),
            (&|s| s.log_scales[1][0] = f32::INFINITY, "number 1 has a scale that is not finite"),
            (&|s| s.rotations[1][3] = f32::NAN, "number 1 has a rotation that is not finite"),
            (&|s| s.rotations[1] = [0.0; 4], "number 1 has a rotation of no length"),
            (&|s| s.harmonics[12] = f32::NAN, "number 1 has a colour that is not finite"),
            (&|s| s.harmonics[23] = f32::NEG_INFINITY, "number 1 has a colour that is not finite"),
        ];
        for (spoil, expected) in cases {
            let (mut splats, mut notes) = (three(), Vec::new());
            spoil(&mut splats);
            let kept = usable(Path::new("a.ply"), splats, &mut notes).unwrap();
            assert_eq!(kept, three().filtered(|i| i != 1));
            assert_eq!(notes, [format!("splats left out: 1; {expected}")]);
        }
        let broken = Gaussians { opacities: vec![f32::NAN; 3], ..three() };
        assert!(
            usable(Path::new("a.ply"), broken, &mut Vec::new()).unwrap_err().to_string().contains("none of its splats")
        );
    }

    /// If this failed, splats that are wholly opaque or flat would be lost, or be drawn as NaN.
    #[test]
    fn opaque_and_flat_splats_are_sound() {
        let mut splats = three();
        splats.opacities = vec![f32::INFINITY, f32::NEG_INFINITY, 1e30];
        splats.log_scales[2] = [0.0, -1.0, f32::NEG_INFINITY];
        let mut notes = Vec::new();
        let kept = usable(Path::new("a.ply"), splats, &mut notes).unwrap();
        assert!(notes.is_empty());
        assert_eq!((kept.opacities, kept.log_scales[2]), (vec![MAX_LOGIT, -MAX_LOGIT, 1e30], [0.0, -1.0, FLAT]));
        assert!((FLAT.exp() * FLAT.exp()).is_normal() && 1.0 / (1.0 + (-MAX_LOGIT).exp()) == 1.0);
    }
}
