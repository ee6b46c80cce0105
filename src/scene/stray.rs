//! Stray points and poses: a few that lie far away from all others must not set the scale of the rest.

use glam::DVec3;

/// Of fewer positions than this none is called stray.
const MIN_COUNT: usize = 10;
/// The share of positions that sets the scale; at most as many as remain may be stray.
const SHARE: f64 = 0.9;
/// How many times as far from the middle as that share a position may lie. Backgrounds of outdoor captures lie within it,
/// failed triangulations and poses beyond.
const FACTOR: f64 = 20.0;

/// Where positions that are not stray lie: a cube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Centre: the medians of the positions along each axis.
    pub centre: DVec3,
    /// Half the side; infinite where the positions set no scale.
    pub half: f64,
    /// The distance from the centre, along any axis, within which nine tenths of the positions lie.
    pub scale: f64,
}

impl Reach {
    /// The reach of finite `positions`: twenty times as far from the middle, along any axis, as nine tenths of them lie. Fewer than ten,
    /// or nine tenths in one place, set no scale.
    pub fn of(positions: &[DVec3]) -> Self {
        let centre = DVec3::from_array([0, 1, 2].map(|axis| {
            let mut values: Vec<f64> = positions.iter().map(|p| p[axis]).collect();
            let middle = values.len() / 2;
            if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
        }));
        let scale = distance_within(positions, centre, SHARE);
        let set = positions.len() >= MIN_COUNT && scale > 0.0;
        Self { centre, half: if set { FACTOR * scale } else { f64::INFINITY }, scale }
    }

    /// The reach of cameras among `points`, half of which widen it: where all cameras but a few stand on one tripod, these few are not
    /// stray.
    pub fn of_cameras(positions: &[DVec3], points: &[DVec3]) -> Self {
        let cameras = Self::of(positions);
        let among = distance_within(points, cameras.centre, 0.5);
        Self { half: cameras.half.max(FACTOR * among), ..cameras }
    }

    /// Whether single precision would move the positions by more than a hundred-thousandth of their scale, as it does far away from the
    /// origin, where georeferenced positions lie.
    pub fn needs_double(&self) -> bool {
        self.centre.abs().max_element() * f64::from(f32::EPSILON) > 1e-5 * self.scale
    }

    /// Whether a position is not stray.
    pub fn holds(&self, position: DVec3) -> bool {
        distance(position, self.centre) <= self.half
    }
}

/// Distance along the axis where it is greatest.
fn distance(p: DVec3, from: DVec3) -> f64 {
    (p - from).abs().max_element()
}

/// The distance from `centre` within which a share of the positions lies; zero where there are none.
fn distance_within(positions: &[DVec3], centre: DVec3, share: f64) -> f64 {
    let mut distances: Vec<f64> = positions.iter().map(|p| distance(*p, centre)).collect();
    let last = distances.len().saturating_sub(1);
    // The conversion rounds down: of ten positions the ninth sets the scale.
    let rank = (share * last as f64) as usize;
    if distances.is_empty() { 0.0 } else { *distances.select_nth_unstable_by(rank, f64::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    fn ball(count: u32, seed: u64) -> Vec<DVec3> {
        let point = |i| {
            let [u, v, w, _] = random::uniforms(seed, 0, i);
            DVec3::new(3.0, -5.0, 1e5) + 2.0 * w * random::direction(u, v)
        };
        (0..count).map(point).collect()
    }

    /// If this failed, one wrong point would set the scale of a surface, or a wide background would be thrown away.
    #[test]
    fn stray_positions_are_beyond_reach_and_backgrounds_within() {
        for seed in 0..20 {
            let mut positions = ball(200, seed);
            let background = DVec3::new(3.0 + 20.0, -5.0, 1e5);
            let strays = [1e3, 1e6, -1e9].map(|far| DVec3::new(0.0, far, 1e5));
            positions.push(background);
            positions.extend(strays);
            let reach = Reach::of(&positions);
            assert!(positions[..201].iter().all(|p| reach.holds(*p)), "{reach:?}");
            assert!(strays.iter().all(|p| !reach.holds(*p)), "{reach:?}");
        }
    }

    /// If this failed, a handful of cameras, a tripod that was moved once, or points on one spot would lose members.
    #[test]
    fn nothing_is_stray_where_there_is_no_scale() {
        let few: Vec<DVec3> = (0..9).map(|i| DVec3::splat(10f64.powi(i))).collect();
        let mut tripod = vec![DVec3::ONE; 30];
        tripod.push(DVec3::splat(3.0));
        let mut shaken = ball(30, 1).into_iter().map(|p| 1e-4 * (p - DVec3::Z * 1e5)).collect::<Vec<_>>();
        shaken.push(DVec3::splat(1.0));
        assert!([&few, &tripod].iter().all(|positions| positions.iter().all(|p| Reach::of(positions).holds(*p))));
        assert!(!shaken.iter().all(|p| Reach::of(&shaken).holds(*p)));
        let points: Vec<DVec3> = ball(100, 2).into_iter().map(|p| p - DVec3::Z * 1e5).collect();
        assert!(shaken.iter().all(|p| Reach::of_cameras(&shaken, &points).holds(*p)));
    }
}
