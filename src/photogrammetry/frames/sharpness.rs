//! How sharp a frame is, whatever it shows: along each of four directions, the energy of fine structures by that of coarse ones.
//!
//! Selection takes the variance of the Laplacian, which compares photos of the same things. Successive frames of a walk show a
//! bookshelf, then a wall: there the ratio compares, for blur takes fine structures first. Motion blurs along one direction and
//! leaves the others, so the least of the four counts. The quarter of the picture with the most structure stands for the
//! whole: of a wall nothing but noise would be measured, which no blur takes.

use super::grey::Grey;

/// Most pixels of the longer side of the pictures that are measured: enough to see a blur of few pixels in the video.
pub const SIDE: usize = 960;
/// Pixels between the values whose second differences are taken. Blurs longer than the coarse step no longer count as more.
const FINE: usize = 1;
const COARSE: usize = 24;
/// Pixels of a block's side.
const BLOCK: usize = 32;
/// Least energy of coarse structures, in squared grey values per pixel, of a picture that shows anything.
const PLAIN: f64 = 30.0;
/// Directions: to the right, down, and the two diagonals.
const DIRECTIONS: [[isize; 2]; 4] = [[1, 0], [0, 1], [1, 1], [1, -1]];

/// Sharpness of a picture, 0 where it is plain. An edge of one pixel is near 0.4, one blurred over `n` pixels near `0.4 / n`.
pub fn of(picture: &Grey) -> f64 {
    let picture = picture.within(SIDE);
    let margin = COARSE;
    let (inner_width, inner_height) =
        (picture.width.saturating_sub(2 * margin), picture.height.saturating_sub(2 * margin));
    let places = |length: usize| (0..length / BLOCK).map(|i| margin + i * BLOCK);
    let mut blocks: Vec<[[f64; 2]; 4]> = Vec::new();
    for y in places(inner_height) {
        for x in places(inner_width) {
            blocks
                .push(DIRECTIONS.map(|direction| [FINE, COARSE].map(|step| energy(&picture, [x, y], direction, step))));
        }
    }
    let coarse = |block: &[[f64; 2]; 4]| block.iter().map(|[_, coarse]| coarse).sum::<f64>();
    blocks.sort_by(|a, b| coarse(b).total_cmp(&coarse(a)));
    blocks.truncate(blocks.len().div_ceil(4));
    let sum = |direction: usize, scale: usize| blocks.iter().map(|block| block[direction][scale]).sum::<f64>();
    if (0..4).map(|direction| sum(direction, 1)).sum::<f64>() <= 4.0 * PLAIN * blocks.len() as f64 {
        return 0.0;
    }
    let ratios = (0..4).map(|direction| sum(direction, 0) / sum(direction, 1).max(f64::MIN_POSITIVE));
    ratios.fold(f64::INFINITY, f64::min).sqrt()
}

/// Mean square of second differences over the block at a place, along a direction.
fn energy(picture: &Grey, [x, y]: [usize; 2], [dx, dy]: [isize; 2], step: usize) -> f64 {
    let offset = step as isize * (dy * picture.width as isize + dx);
    let mut sum = 0u64;
    for v in y..y + BLOCK {
        let start = v * picture.width + x;
        // The margin around blocks is as wide as the coarse step: all three rows lie inside.
        let row = |start: usize| &picture.values[start..start + BLOCK];
        let (before, middle, after) =
            (row(start.wrapping_add_signed(-offset)), row(start), row(start.wrapping_add_signed(offset)));
        let squares = before.iter().zip(middle).zip(after).map(|((before, middle), after)| {
            let bend = 2 * i32::from(*middle) - i32::from(*before) - i32::from(*after);
            (bend * bend) as u32
        });
        sum += u64::from(squares.sum::<u32>());
    }
    sum as f64 / (BLOCK * BLOCK) as f64
}

#[cfg(test)]
mod tests {
    use super::super::grey::fixtures::{picture, plane, view};
    use super::*;

    const SIZE: [usize; 2] = [320, 180];

    /// If this failed, of two blurred frames the worse could be chosen.
    #[test]
    fn the_longer_the_blur_the_less_sharp() {
        let found = [0.0, 2.0, 4.0, 8.0, 12.0].map(|blur| of(&view(SIZE, 0.0, 0.0, blur)));
        assert!(found.windows(2).all(|pair| pair[1] < 0.85 * pair[0]), "{found:?}");
    }

    /// If this failed, motion blur along a diagonal or along y would go unnoticed, since other directions stay sharp.
    #[test]
    fn blur_in_any_direction_counts() {
        let sharp = of(&view(SIZE, 0.0, 0.0, 0.0));
        for [dx, dy] in [[1.0, 0.0], [0.0, 1.0], [0.7, 0.7], [0.7, -0.7]] {
            let blurred = picture(SIZE, 0.0, 0, |u, v| {
                let at = |i: i32| plane(u + dx * f64::from(i), v + dy * f64::from(i));
                (-3..=3).map(at).sum::<f64>() / 7.0
            });
            assert!(of(&blurred) < 0.5 * sharp, "along {dx}, {dy}: {} and {sharp} without", of(&blurred));
        }
    }

    /// If this failed, frames that show much wall would be left out for blurred ones that show a bookshelf.
    #[test]
    fn plain_walls_are_not_taken_for_blur() {
        let scene = |u: f64, v: f64| if u < 110.0 { plane(u, v) } else { 130.0 };
        let part = |noise: f64, blur: f64| {
            let smeared = |u, v| (-8..=8).map(|i| scene(u + blur * f64::from(i) / 16.0, v)).sum::<f64>() / 17.0;
            picture(SIZE, noise, 4, smeared)
        };
        let whole = of(&view(SIZE, 0.0, 0.0, 0.0));
        for noise in [0.0, 3.0] {
            assert!(of(&part(noise, 0.0)) > 0.7 * whole, "noise {noise}: {} and {whole}", of(&part(noise, 0.0)));
            let (blurred, sharp) = (of(&part(noise, 6.0)), of(&part(noise, 0.0)));
            assert!(blurred < 0.6 * sharp, "noise {noise}: {blurred} and {sharp} without blur");
        }
    }

    /// If this failed, exposure or a room in dim light would change what counts as sharp.
    #[test]
    fn contrast_does_not_count() {
        let dim = picture(SIZE, 0.0, 0, |u, v| 20.0 + 0.4 * plane(u, v));
        let (dim, bright) = (of(&dim), of(&view(SIZE, 0.0, 0.0, 0.0)));
        assert!((dim / bright - 1.0).abs() < 0.1, "{dim} and {bright}");
    }

    /// If this failed, a covered lens or a picture of a few pixels would seem sharp or end the program.
    #[test]
    fn nothing_is_not_sharp() {
        assert_eq!(of(&picture(SIZE, 3.0, 1, |_, _| 90.0)), 0.0);
        assert_eq!(of(&Grey::default()), 0.0);
        assert_eq!(of(&view([30, 30], 0.0, 0.0, 0.0)), 0.0);
    }
}
