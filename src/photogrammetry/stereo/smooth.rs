//! Depth across smooth patches: walls and paint that show no texture, between what has depth around them.

use super::frame::Frame;

/// Pixels that a gap is looked across in each direction, in parts of the picture's longer side.
const REACH: f32 = 0.15;
/// Change of brightness from a pixel to the next that is an edge, which no gap is closed across.
const EDGE: f32 = 0.05;
/// How far the lines through a pixel may differ in depth, as a fraction.
const SPREAD: f32 = 0.02;
/// The lines: a direction and its opposite.
const LINES: [[isize; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];

/// Depths for those pixels of a frame that have none (0) but lie between pixels that have: inverse depth is linear on a plane,
/// so each line through the pixel, from the first depth one way to the first the other, gives one, and where at least three
/// agree their mean is taken. Elsewhere 0. Edges and the object's outline end a line.
pub(crate) fn across_gaps(frame: &Frame, depths: &[f32]) -> Vec<f32> {
    let [width, height] = [frame.camera.intrinsics.width, frame.camera.intrinsics.height].map(|side| side as isize);
    let reach = (REACH * width.max(height) as f32) as isize;
    let covered = |at: usize| frame.mask.as_ref().is_none_or(|mask| mask[at] >= 0.5);
    // Distance to the first depth along a direction, and that depth inverted.
    let first = |[x, y]: [isize; 2], [dx, dy]: [isize; 2]| {
        let mut last = frame.brightness[(y * width + x) as usize];
        for step in 1..=reach {
            let [x, y] = [x + step * dx, y + step * dy];
            if x < 0 || y < 0 || x >= width || y >= height {
                return None;
            }
            let at = (y * width + x) as usize;
            if depths[at] > 0.0 {
                return Some((step as f32, 1.0 / depths[at]));
            }
            if !covered(at) || (frame.brightness[at] - last).abs() > EDGE {
                return None;
            }
            last = frame.brightness[at];
        }
        None
    };
    let fill = |at: usize| {
        if depths[at] > 0.0 || !covered(at) {
            return 0.0;
        }
        let pixel = [at as isize % width, at as isize / width];
        let across = |[dx, dy]: [isize; 2]| {
            let ((a, wa), (b, wb)) = (first(pixel, [dx, dy])?, first(pixel, [-dx, -dy])?);
            Some((b * wa + a * wb) / (a + b))
        };
        let found: Vec<f32> = LINES.into_iter().filter_map(across).collect();
        let (low, high) = found.iter().fold((f32::INFINITY, 0f32), |(low, high), w| (low.min(*w), high.max(*w)));
        if found.len() < 3 || high > (1.0 + SPREAD) * low {
            return 0.0;
        }
        found.len() as f32 / found.iter().sum::<f32>()
    };
    (0..depths.len()).map(fill).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::camera::{Camera, Intrinsics, Pose};
    use glam::{DQuat, DVec3};

    const SIDE: u32 = 40;

    fn frame(brightness: Vec<f32>) -> Frame {
        let pose = Pose { position: DVec3::ZERO, rotation: DQuat::IDENTITY };
        let camera = Camera { name: String::new(), pose, intrinsics: Intrinsics::from_fov(SIDE, SIDE, 1.0) };
        Frame { camera, colours: Vec::new(), brightness, mask: None }
    }

    /// If this failed, smooth walls would keep their holes, or holes would be closed across an outline with what is neither
    /// of the two surfaces beside it.
    #[test]
    fn a_gap_in_a_tilted_plane_is_closed_and_one_across_an_edge_is_not() {
        let plane = |i: u32| 1.0 / (0.5 + 0.002 * (i % SIDE) as f32 + 0.001 * (i / SIDE) as f32);
        let gap = |i: u32| (18..22).contains(&(i % SIDE)) && (18..22).contains(&(i / SIDE));
        let depths: Vec<f32> = (0..SIDE * SIDE).map(|i| if gap(i) { 0.0 } else { plane(i) }).collect();
        let even = across_gaps(&frame(vec![0.5; depths.len()]), &depths);
        for (i, closed) in (0..).zip(&even) {
            let wanted = if gap(i) { plane(i) } else { 0.0 };
            assert!((closed - wanted).abs() < 1e-4, "pixel {i}: {closed}, not {wanted}");
        }
        let edged = (0..SIDE * SIDE).map(|i| if i % SIDE < 20 { 0.3 } else { 0.7 }).collect();
        assert!(across_gaps(&frame(edged), &depths).iter().all(|closed| *closed == 0.0));
    }
}
