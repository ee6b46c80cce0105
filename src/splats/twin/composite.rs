//! Front to back over the pixels of a picture, and gradients back to front.

use glam::{DVec2, DVec3};

use super::project::{Gradient, Projected};
use super::{Picture, Rules, View};
use crate::engine::parallel::in_parallel;

/// Pixels along a side of a tile; all its pixels look at the same splats.
const TILE: u32 = 16;

/// The splats that may show in a tile, front to back, with what is summed over its pixels.
struct Tile {
    /// First pixel (x, y).
    corner: [u32; 2],
    splats: Vec<usize>,
    pixels: Vec<Pixel>,
    gradients: Vec<Gradient>,
}

#[derive(Clone, Copy)]
struct Pixel {
    at: usize,
    colour: DVec3,
    transmittance: f64,
    depth: f64,
}

/// A splat's part in a pixel.
struct Part {
    /// Index in the tile's list.
    place: usize,
    /// From the splat's mean to the pixel's centre.
    offset: DVec2,
    /// exp(-sigma).
    falloff: f64,
    alpha: f64,
    /// Whether alpha is what opacity and falloff make it, not the most there may be.
    free: bool,
    /// What passes all splats in front.
    transmittance: f64,
}

/// Renders projected splats.
pub fn forward(projected: &[Option<Projected>], view: &View, rules: &Rules, background: DVec3) -> Picture {
    let mut tiles = tiles(projected, view, rules);
    in_parallel(&mut tiles, 1, |_, tiles| {
        for tile in tiles {
            let mut parts = Vec::new();
            for (at, centre) in pixels(tile.corner, view) {
                let transmittance = walk(projected, &tile.splats, centre, rules, &mut parts);
                let mut pixel = Pixel { at, colour: transmittance * background, transmittance, depth: 0.0 };
                for (part, splat) in parts.iter().filter_map(|part| Some((part, projected[tile.splats[part.place]]?))) {
                    pixel.colour += part.transmittance * part.alpha * splat.colour;
                    pixel.depth += part.transmittance * part.alpha * splat.depth;
                }
                tile.pixels.push(pixel);
            }
        }
    });
    let mut picture = Picture {
        colour: vec![DVec3::ZERO; view.pixels()],
        transmittance: vec![0.0; view.pixels()],
        depth: vec![0.0; view.pixels()],
    };
    for pixel in tiles.iter().flat_map(|tile| &tile.pixels) {
        picture.colour[pixel.at] = pixel.colour;
        picture.transmittance[pixel.at] = pixel.transmittance;
        picture.depth[pixel.at] = pixel.depth;
    }
    picture
}

/// Gradient by every projected splat.
pub fn backward(
    projected: &[Option<Projected>],
    view: &View,
    rules: &Rules,
    background: DVec3,
    by_colour: &[DVec3],
) -> Vec<Gradient> {
    let mut tiles = tiles(projected, view, rules);
    in_parallel(&mut tiles, 1, |_, tiles| {
        for tile in tiles {
            tile.gradients = vec![Gradient::default(); tile.splats.len()];
            let mut parts = Vec::new();
            for (at, centre) in pixels(tile.corner, view) {
                walk(projected, &tile.splats, centre, rules, &mut parts);
                // What is seen behind the splat, as if nothing were in front.
                let mut behind = background;
                for part in parts.iter().rev() {
                    let Some(splat) = projected[tile.splats[part.place]] else { continue };
                    add(&mut tile.gradients[part.place], &splat, part, behind, by_colour[at]);
                    behind = part.alpha * splat.colour + (1.0 - part.alpha) * behind;
                }
            }
        }
    });
    let mut sums = vec![Gradient::default(); projected.len()];
    for (splat, gradient) in tiles.iter().flat_map(|tile| tile.splats.iter().zip(&tile.gradients)) {
        let sum = &mut sums[*splat];
        sum.mean += gradient.mean;
        (0..3).for_each(|k| sum.conic[k] += gradient.conic[k]);
        sum.opacity += gradient.opacity;
        sum.colour += gradient.colour;
    }
    sums
}

/// Adds what one pixel gives to a splat's gradient.
fn add(gradient: &mut Gradient, splat: &Projected, part: &Part, behind: DVec3, by_colour: DVec3) {
    gradient.colour += part.transmittance * part.alpha * by_colour;
    if !part.free {
        return;
    }
    let by_alpha = part.transmittance * by_colour.dot(splat.colour - behind);
    let by_sigma = -by_alpha * part.alpha;
    let ([a, b, c], DVec2 { x, y }) = (splat.conic, part.offset);
    gradient.opacity += by_alpha * part.falloff;
    gradient.conic[0] += by_sigma * 0.5 * x * x;
    gradient.conic[1] += by_sigma * x * y;
    gradient.conic[2] += by_sigma * 0.5 * y * y;
    gradient.mean -= by_sigma * DVec2::new(a * x + b * y, b * x + c * y);
}

/// Finds the splats that have a part in a pixel, front to back, and returns what passes all of them.
fn walk(projected: &[Option<Projected>], splats: &[usize], centre: DVec2, rules: &Rules, parts: &mut Vec<Part>) -> f64 {
    parts.clear();
    let mut transmittance = 1.0;
    for (place, splat) in splats.iter().enumerate().filter_map(|(place, splat)| Some((place, projected[*splat]?))) {
        let offset = centre - splat.mean;
        let [a, b, c] = splat.conic;
        let sigma = 0.5 * (a * offset.x * offset.x + c * offset.y * offset.y) + b * offset.x * offset.y;
        let falloff = (-sigma).exp();
        let full = splat.opacity * falloff;
        let alpha = full.min(rules.most_alpha);
        if sigma < 0.0 || alpha < rules.least_alpha {
            continue;
        }
        let next = transmittance * (1.0 - alpha);
        if next < rules.least_transmittance {
            break;
        }
        parts.push(Part { place, offset, falloff, alpha, free: full <= rules.most_alpha, transmittance });
        transmittance = next;
    }
    transmittance
}

/// Index and centre of each pixel of the tile at `corner`.
fn pixels(corner: [u32; 2], view: &View) -> impl Iterator<Item = (usize, DVec2)> {
    let end = [(corner[0] + TILE).min(view.width), (corner[1] + TILE).min(view.height)];
    let width = view.width as usize;
    (corner[1]..end[1]).flat_map(move |j| {
        (corner[0]..end[0])
            .map(move |i| (j as usize * width + i as usize, DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5)))
    })
}

/// All tiles of the picture with the splats that may show there, by depth and then by index.
fn tiles(projected: &[Option<Projected>], view: &View, rules: &Rules) -> Vec<Tile> {
    let across = view.width.div_ceil(TILE);
    let down = view.height.div_ceil(TILE);
    let corners = (0..down).flat_map(|j| (0..across).map(move |i| [i * TILE, j * TILE]));
    let mut tiles: Vec<Tile> =
        corners.map(|corner| Tile { corner, splats: Vec::new(), pixels: Vec::new(), gradients: Vec::new() }).collect();
    let mut order: Vec<(usize, &Projected)> =
        projected.iter().enumerate().filter_map(|(i, splat)| Some((i, splat.as_ref()?))).collect();
    // The sort is stable: equal depths stay in the order of the list.
    order.sort_by(|a, b| a.1.depth.total_cmp(&b.1.depth));
    for (index, splat) in order {
        let [xx, _, yy] = splat.covariance;
        // Where alpha reaches the least: sigma = log(opacity / least), an ellipse in this box. A pixel more for rounding.
        let reach = 2.0 * (splat.opacity / rules.least_alpha).ln().max(0.0);
        let half = DVec2::new((reach * xx).sqrt(), (reach * yy).sqrt()) + 1.0;
        let span = |mean: f64, half: f64, tiles: u32| {
            // Conversions clamp to the picture's tiles.
            let first = ((mean - half) / f64::from(TILE)).floor().max(0.0) as u32;
            first..(((mean + half) / f64::from(TILE)).floor() + 1.0).clamp(0.0, f64::from(tiles)) as u32
        };
        for j in span(splat.mean.y, half.y, down) {
            for i in span(splat.mean.x, half.x, across) {
                tiles[(j * across + i) as usize].splats.push(index);
            }
        }
    }
    tiles
}
