//! How far the picture moves between two frames: blocks with texture in both directions are matched from coarse to fine by their
//! normalised cross-correlation, and the median of their displacements counts. A block that something moved through, or that
//! was matched wrongly, does not sway a median; panning, walking forwards and turning about the axis all move most blocks.

use super::grey::Grey;

/// Most pixels of the longer side of the pictures that are matched.
pub const SIDE: usize = 320;
/// Most pixels of the longer side of the coarsest level.
const COARSEST: usize = 48;
/// Pixels from a block's middle to its sides, and between the middles of blocks at the finest level.
const HALF: i32 = 8;
const BETWEEN: i32 = 20;
/// Least mean square slope, in grey values per pixel, across a block's weaker direction: noise that is left in small pictures is
/// below it, and along a straight edge a match would slide.
const TEXTURE: f64 = 4.0;
/// Least correlation of a match.
const MATCHED: f64 = 0.75;
/// Least number of blocks that must be matched, their least share of all with texture, and of those whose match would lie in the other
/// picture: of two pictures of different things, some blocks are alike by chance, and of two of the same, most are.
const NUMBER: usize = 6;
const SHARE: f64 = 0.2;
const OF_COMMON: f64 = 0.4;
/// Pixels that a level searches to each side of what the coarser one found.
const SEARCH: i32 = 2;
/// Levels, from the finest, that may give the answer: where motion blur has taken the finest structures, coarser ones remain.
const ANSWERING: usize = 3;

/// A frame at halved sizes, for [`between`].
#[derive(Clone, Debug)]
pub struct Pyramid {
    /// Finest first.
    levels: Vec<Grey>,
    /// Middles of blocks with texture in both directions, at the finest level.
    blocks: Vec<[i32; 2]>,
}

impl Pyramid {
    /// Of a picture of any size.
    pub fn new(picture: &Grey) -> Self {
        let mut levels = vec![picture.within(SIDE)];
        while let Some(last) = levels.last().filter(|last| last.longer() > COARSEST) {
            levels.push(last.shrunk(2));
        }
        let blocks = blocks(&levels[0]);
        Self { levels, blocks }
    }

    /// Whether enough of the picture has texture that motion can be measured: not on a plain wall or with the lens covered.
    pub fn has_texture(&self) -> bool {
        self.blocks.len() >= NUMBER
    }
}

/// The median motion from one frame to the other as a share of the picture: of a pan by a tenth of the width, 0.1. None
/// where the pictures cannot be matched: without texture, after a cut, or where little of one is in the other.
pub fn between(from: &Pyramid, to: &Pyramid) -> Option<f64> {
    let depth = from.levels.len();
    let sizes = |pyramid: &Pyramid| pyramid.levels.iter().map(|level| [level.width, level.height]).collect::<Vec<_>>();
    if !from.has_texture() || sizes(from) != sizes(to) {
        return None;
    }
    let global = global_shift(&from.levels[depth - 1], &to.levels[depth - 1]);
    let double = |shift: [i32; 2]| shift.map(|value| 2 * value);
    // Where the coarsest level is also the finest, its shift is the first guess there.
    let mut guesses: Vec<[i32; 2]> = vec![global; from.blocks.len()];
    let mut answers: Vec<Vec<Option<Match>>> = vec![Vec::new(); depth];
    for level in (0..depth.saturating_sub(1).max(1)).rev() {
        let (a, b) = (&from.levels[level], &to.levels[level]);
        let is_first = level + 2 >= depth;
        if level + 1 < depth {
            guesses.iter_mut().for_each(|guess| *guess = double(*guess));
        }
        let search = |(middle, guess): (&[i32; 2], &[i32; 2])| {
            // At rest beside a large thing that moves, the shift of the whole picture is not that of the block.
            let others = if is_first { [*guess, [0, 0]] } else { [*guess; 2] };
            best(a, b, at_level(*middle, a, level), others)
        };
        let found: Vec<Option<Match>> = from.blocks.iter().zip(&guesses).map(search).collect();
        // What moves out of a small picture may be found in a larger one.
        for (guess, found) in guesses.iter_mut().zip(&found) {
            *guess = found.as_ref().map_or(*guess, |found| found.shift);
        }
        answers[level] = found;
    }
    let least = NUMBER.max((SHARE * from.blocks.len() as f64).ceil() as usize);
    (0..depth.min(ANSWERING)).find_map(|level| {
        let (a, b) = (&from.levels[level], &to.levels[level]);
        let blocks = from.blocks.iter().zip(&answers[level]);
        let matched = blocks.filter_map(|(middle, found)| {
            let found = found.as_ref().filter(|found| found.correlation >= MATCHED)?;
            let [x, y] = refined(a, b, at_level(*middle, a, level), found);
            Some((x / a.width as f64).hypot(y / a.height as f64))
        });
        let mut motions: Vec<f64> = matched.collect();
        let in_common = answers[level].iter().flatten().count();
        if motions.len() < least.max((OF_COMMON * in_common as f64).ceil() as usize) {
            return None;
        }
        motions.sort_unstable_by(f64::total_cmp);
        Some(motions[motions.len() / 2])
    })
}

/// Middles of blocks whose slopes are strong across both directions (Shi and Tomasi, "Good Features to Track", 1994).
fn blocks(picture: &Grey) -> Vec<[i32; 2]> {
    let (width, height) = (picture.width as i32, picture.height as i32);
    // In the middles of equal cells, so that every part of the picture has the same weight.
    let places = |length: i32| {
        let margin = (length % BETWEEN + BETWEEN) / 2;
        (margin..length - HALF).step_by(BETWEEN as usize)
    };
    let mut found = Vec::new();
    for y in places(height) {
        for x in places(width) {
            let (mut xx, mut xy, mut yy) = (0i32, 0i32, 0i32);
            for v in y - HALF..y + HALF {
                for u in x - HALF..x + HALF {
                    let at = |u: i32, v: i32| picture.at(u as usize, v as usize);
                    let (dx, dy) = (at(u + 1, v) - at(u - 1, v), at(u, v + 1) - at(u, v - 1));
                    (xx, xy, yy) = (xx + dx * dx, xy + dx * dy, yy + dy * dy);
                }
            }
            let [xx, xy, yy] = [xx, xy, yy].map(f64::from);
            let weaker = 0.5 * (xx + yy - (xx - yy).hypot(2.0 * xy));
            // Differences over two pixels: a quarter of their square is that of the slope.
            if weaker / f64::from(16 * HALF * HALF) >= TEXTURE {
                found.push([x, y]);
            }
        }
    }
    found
}

/// The shift of the whole picture that correlates best, among those that leave at least two fifths of each side in common.
fn global_shift(a: &Grey, b: &Grey) -> [i32; 2] {
    let (width, height) = (a.width as i32, a.height as i32);
    let reach = |length: i32| 3 * length / 5;
    let mut best = (f64::NEG_INFINITY, [0, 0]);
    for dy in -reach(height)..=reach(height) {
        for dx in -reach(width)..=reach(width) {
            let (left, right) = (0.max(-dx), width.min(width - dx));
            let (top, bottom) = (0.max(-dy), height.min(height - dy));
            let size = [right - left, bottom - top];
            let correlation = correlation(a, b, [left, top], [left + dx, top + dy], size);
            // A small part in common is more easily alike by chance.
            let common = f64::from(size[0] * size[1]) / f64::from(width * height);
            let score = correlation * common.sqrt();
            if score > best.0 {
                best = (score, [dx, dy]);
            }
        }
    }
    best.1
}

/// The middle of a block at a coarser level, moved inwards where it would reach over the border there.
fn at_level(middle: [i32; 2], picture: &Grey, level: usize) -> [i32; 2] {
    let inside = |value: i32, length: usize| (value >> level).min(length as i32 - HALF).max(HALF);
    [inside(middle[0], picture.width), inside(middle[1], picture.height)]
}

/// Where a block was found.
#[derive(Clone, Debug)]
struct Match {
    /// Displacement in pixels of the level.
    shift: [i32; 2],
    correlation: f64,
}

/// The best match of the block around `middle` near any of the guesses; none where all lie outside.
fn best(a: &Grey, b: &Grey, middle: [i32; 2], guesses: [[i32; 2]; 2]) -> Option<Match> {
    let mut found: Option<Match> = None;
    for (i, guess) in guesses.iter().enumerate() {
        if guesses[..i].contains(guess) {
            continue;
        }
        for dy in -SEARCH..=SEARCH {
            for dx in -SEARCH..=SEARCH {
                let shift = [guess[0] + dx, guess[1] + dy];
                let Some(correlation) = block_correlation(a, b, middle, shift) else { continue };
                if found.as_ref().is_none_or(|found| correlation > found.correlation) {
                    found = Some(Match { shift, correlation });
                }
            }
        }
    }
    found
}

/// A match to parts of a pixel: the peak of the parabola through its neighbours, along each axis.
fn refined(a: &Grey, b: &Grey, middle: [i32; 2], found: &Match) -> [f64; 2] {
    let [x, y] = found.shift;
    let peak = |before: [i32; 2], after: [i32; 2]| {
        let sides = [before, after].map(|shift| block_correlation(a, b, middle, shift));
        let [Some(before), Some(after)] = sides else { return 0.0 };
        let bend = before - 2.0 * found.correlation + after;
        if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 }
    };
    [f64::from(x) + peak([x - 1, y], [x + 1, y]), f64::from(y) + peak([x, y - 1], [x, y + 1])]
}

/// The correlation of a block with its displaced place; none where either lies outside of its picture.
fn block_correlation(a: &Grey, b: &Grey, [x, y]: [i32; 2], [dx, dy]: [i32; 2]) -> Option<f64> {
    let inside = |picture: &Grey, x: i32, y: i32| {
        x >= HALF && y >= HALF && x + HALF <= picture.width as i32 && y + HALF <= picture.height as i32
    };
    if !inside(a, x, y) || !inside(b, x + dx, y + dy) {
        return None;
    }
    Some(correlation(a, b, [x - HALF, y - HALF], [x + dx - HALF, y + dy - HALF], [2 * HALF; 2]))
}

/// Normalised cross-correlation of two places of the same size, in [-1, 1]; 0 where either is plain.
fn correlation(a: &Grey, b: &Grey, [ax, ay]: [i32; 2], [bx, by]: [i32; 2], [width, height]: [i32; 2]) -> f64 {
    let (mut sa, mut sb, mut saa, mut sbb, mut sab) = (0u32, 0u32, 0u32, 0u32, 0u32);
    for row in 0..height {
        let row_of = |picture: &'_ Grey, x: i32, y: i32| {
            let start = (y + row) as usize * picture.width + x as usize;
            start..start + width as usize
        };
        let (of_a, of_b) = (&a.values[row_of(a, ax, ay)], &b.values[row_of(b, bx, by)]);
        for (p, q) in of_a.iter().zip(of_b) {
            let (p, q) = (u32::from(*p), u32::from(*q));
            (sa, sb) = (sa + p, sb + q);
            (saa, sbb, sab) = (saa + p * p, sbb + q * q, sab + p * q);
        }
    }
    let [n, sa, sb, saa, sbb, sab] = [(width * height) as u32, sa, sb, saa, sbb, sab].map(f64::from);
    let spread = (n * saa - sa * sa) * (n * sbb - sb * sb);
    if spread > 0.0 { (n * sab - sa * sb) / spread.sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::choice::DUPLICATE;
    use super::super::grey::fixtures::{picture, plane, view};
    use super::*;

    const SIZE: [usize; 2] = [320, 180];

    fn motion(a: &Grey, b: &Grey) -> Option<f64> {
        between(&Pyramid::new(a), &Pyramid::new(b))
    }

    /// If this failed, frames would not be even in true motion: pans would count for more or less than they are.
    #[test]
    fn a_pan_is_measured_to_a_fifth_of_a_pixel() {
        let start = view(SIZE, 0.0, 0.0, 0.0);
        for (x, y) in [(0.0, 0.0), (0.4, 0.0), (3.0, -1.5), (-7.3, 2.0), (31.0, 0.0), (-60.5, 20.0), (120.0, -9.0)] {
            let found = motion(&start, &view(SIZE, x, y, 0.0)).unwrap();
            let known = (x / 320.0_f64).hypot(y / 180.0);
            assert!((found - known).abs() < 0.2 / 180.0, "{x}, {y}: {found} and not {known}");
        }
    }

    /// If this failed, walking forwards or turning the camera about its axis would count as standing still.
    #[test]
    fn growing_and_turning_pictures_move_by_the_median_of_their_pixels() {
        let start = view(SIZE, 0.0, 0.0, 0.0);
        for (scale, turn) in [(1.05, 0.0_f64), (0.93, 0.0), (1.0, 0.05), (1.04, -0.04)] {
            let (sin, cos) = turn.sin_cos();
            let moved = |u: f64, v: f64| {
                let (x, y) = (u - 160.0, v - 90.0);
                [160.0 + (cos * x - sin * y) / scale, 90.0 + (sin * x + cos * y) / scale]
            };
            let end = picture(SIZE, 0.0, 0, |u, v| {
                let [x, y] = moved(u, v);
                plane(x, y)
            });
            // Blocks stand for all of the first picture; what ends less than half a block from the border of the other is not found.
            let is_first = |x: f64, y: f64| (0.0..320.0).contains(&x) && (0.0..180.0).contains(&y);
            let is_found = |u: f64, v: f64| (8.0..312.0).contains(&u) && (8.0..172.0).contains(&v);
            let shares = (0..320 * 180).filter_map(|i| {
                let (u, v) = (f64::from(i % 320), f64::from(i / 320));
                let [x, y] = moved(u, v);
                (is_first(x, y) && is_found(u, v)).then(|| ((x - u) / 320.0).hypot((y - v) / 180.0))
            });
            let mut shares: Vec<f64> = shares.collect();
            shares.sort_by(f64::total_cmp);
            let (known, found) = (shares[shares.len() / 2], motion(&start, &end).unwrap());
            assert!((found / known - 1.0).abs() < 0.1, "scale {scale}, turn {turn}: {found} and not {known}");
        }
    }

    /// If this failed, a still camera would seem to creep by its noise, and pauses would be given frames.
    #[test]
    fn noise_does_not_move_a_picture() {
        let noisy = |amount, seed| picture(SIZE, amount, seed, plane);
        for amount in [1.0, 3.0, 8.0] {
            let found = motion(&noisy(amount, 1), &noisy(amount, 2)).unwrap();
            // A tenth of what makes two frames differ.
            assert!(found < 0.1 * DUPLICATE, "{found} with noise of {amount} grey values");
        }
    }

    /// If this failed, someone who walks through the picture would count as motion of the camera.
    #[test]
    fn a_thing_that_crosses_a_still_picture_does_not_move_it() {
        let with_thing = |at: f64| {
            picture(SIZE, 0.0, 0, |u, v| {
                let is_thing = (at..at + 90.0).contains(&u) && v > 40.0;
                if is_thing { plane(u - at + 900.0, v + 500.0) } else { plane(u, v) }
            })
        };
        let found = motion(&with_thing(20.0), &with_thing(80.0)).unwrap();
        assert!(found < 0.1 * DUPLICATE, "{found}");
    }

    /// If this failed, motion blur, which fast turns bring, would make them seem shorter than they are or break the walk apart.
    #[test]
    fn blurred_frames_are_followed() {
        for blur in [4.0, 10.0, 16.0] {
            let found = motion(&view(SIZE, 0.0, 0.0, 0.5 * blur), &view(SIZE, 24.0, 0.0, blur));
            let found = found.unwrap_or_else(|| panic!("a blur of {blur} pixels was not followed"));
            assert!((found - 24.0 / 320.0).abs() < 1.0 / 320.0, "blur {blur}: {found}");
        }
    }

    /// If this failed, cuts and plain walls would be given some motion that means nothing.
    #[test]
    fn what_cannot_be_matched_is_not_measured() {
        let start = view(SIZE, 0.0, 0.0, 0.0);
        assert_eq!(motion(&start, &view(SIZE, 5000.0, 3000.0, 0.0)), None);
        let wall = |seed| picture(SIZE, 2.0, seed, |u, _| 100.0 + 0.1 * u);
        assert_eq!(motion(&wall(1), &wall(2)), None);
        assert!(!Pyramid::new(&wall(1)).has_texture());
        assert_eq!(motion(&start, &view([180, 320], 0.0, 0.0, 0.0)), None);
        // Along stripes nothing says how far they move.
        let stripes = picture(SIZE, 0.0, 0, |u, _| if (u / 8.0).rem_euclid(2.0) < 1.0 { 60.0 } else { 180.0 });
        assert!(!Pyramid::new(&stripes).has_texture());
        // Smaller than any block.
        assert_eq!(motion(&view([12, 9], 0.0, 0.0, 0.0), &view([12, 9], 0.0, 0.0, 0.0)), None);
    }
}
