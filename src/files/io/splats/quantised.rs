//! Values in eight bits and quaternions in 32, as several formats of splats have them.

/// Opacities of 0 and 1 have no logit: they count as this far from them, a quarter of a step.
const MIN_OPACITY: f64 = 0.25 / 255.0;

/// Log scales beyond this are as good as this: they would take the steps of all others.
pub(in crate::files::io) const WIDEST: f32 = 20.0;

/// The nearest of 0 to 255.
pub(in crate::files::io) fn byte(value: f64) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// The logit of an opacity in steps of 1/255.
pub(in crate::files::io) fn logit(opacity: u8) -> f64 {
    let opacity = (f64::from(opacity) / 255.0).clamp(MIN_OPACITY, 1.0 - MIN_OPACITY);
    (opacity / (1.0 - opacity)).ln()
}

/// A quaternion of unit length without its largest component, which is positive after a change of all signs: which one that was, and the
/// others in their order, of at most sqrt(1/2) in size. A quaternion of no length counts as no rotation.
pub(in crate::files::io) fn smallest_three(quaternion: [f32; 4]) -> (usize, [f64; 3]) {
    let q = quaternion.map(f64::from);
    let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut largest = 0;
    (1..4).filter(|i| q[*i].abs() > q[0].abs()).for_each(|i| {
        if q[i].abs() > q[largest].abs() {
            largest = i;
        }
    });
    let sign = if q[largest] < 0.0 { -1.0 } else { 1.0 } / length;
    let mut others = (0..4).filter(|i| *i != largest).map(|i| if length > 0.0 { sign * q[i] } else { 0.0 });
    (largest, [0, 1, 2].map(|_| others.next().unwrap_or_default()))
}

/// The quaternion whose component `left_out` is the largest, from the others in their order.
pub(in crate::files::io) fn from_smallest_three(left_out: usize, others: [f64; 3]) -> [f32; 4] {
    let largest = (1.0 - others.iter().map(|v| v * v).sum::<f64>()).max(0.0).sqrt();
    let mut others = others.into_iter();
    [0, 1, 2, 3].map(|i| if i == left_out { largest } else { others.next().unwrap_or_default() } as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, splats would be turned after a round trip, or one without a rotation be no number.
    #[test]
    fn three_components_give_back_the_fourth() {
        for q in [[0.1f32, -0.7, 0.3, 0.6], [-2.0, 0.0, 0.5, -0.25], [0.0, 0.0, 0.0, -1.0], [0.5; 4]] {
            let (left_out, others) = smallest_three(q);
            assert!(others.iter().all(|v| v.abs() <= 0.5f64.sqrt() + 1e-9), "{others:?}");
            let back = from_smallest_three(left_out, others);
            let length = q.iter().map(|v| v * v).sum::<f32>().sqrt();
            let dot: f32 = back.iter().zip(q).map(|(a, b)| a * b / length).sum();
            assert!((dot.abs() - 1.0).abs() < 1e-6, "{q:?} came back as {back:?}");
        }
        assert_eq!(from_smallest_three(smallest_three([0.0; 4]).0, smallest_three([0.0; 4]).1), [1.0, 0.0, 0.0, 0.0]);
    }

    /// If this failed, opaque splats would come back as infinite, or opacities as others.
    #[test]
    fn opacities_survive_eight_bits() {
        for step in 0..=255u8 {
            let logit = logit(step);
            assert!(logit.is_finite() && byte(255.0 / (1.0 + (-logit).exp())) == step, "{step}");
        }
    }
}
