//! The shot list from above: what was reconstructed, where photos were taken, and where new ones are to be.

use std::fmt::Write as _;

use glam::{DVec2, DVec3};

use super::text::escape;
use crate::files::io::picture::stem;
use crate::scene::camera::Camera;
use crate::scene::directions::Unit;
use crate::scene::surface::Points;

/// Width of the drawing, and its height at most, in pixels.
const SIDE: f64 = 720.0;
/// Points that are drawn at most.
const DOTS: usize = 2500;
/// Points beside this share of all on each side do not widen the drawing.
const STRAY: f64 = 0.02;
/// Room for numbers at the border, and length of an arrow, in pixels.
const BORDER: f64 = 24.0;
const ARROW: f64 = 22.0;

/// Cameras on the map.
pub struct Places<'p> {
    /// Those that are to be, which have numbers.
    pub planned: &'p [Camera],
    /// Photos.
    pub kept: &'p [Camera],
    /// Upwards.
    pub up: DVec3,
}

/// A point of the surface on the map.
pub struct Dot {
    /// Where it is.
    pub position: DVec3,
    /// What it is filled with, as SVG has it.
    pub fill: String,
}

/// Reconstructed points in their own colours.
pub fn coloured(points: &Points) -> Vec<Dot> {
    let fill = |i: usize| {
        let [r, g, b] = points.colours.get(i).copied().unwrap_or([150; 3]);
        format!("#{r:02x}{g:02x}{b:02x}")
    };
    points.positions.iter().enumerate().map(|(i, position)| Dot { position: *position, fill: fill(i) }).collect()
}

/// The drawing. `from` are the photos, by index among planned ones and photos, that shots are started from; they have their names.
///
/// Points above nine tenths of the lenses are left out: ceilings would hide what they cover. A bar in the corner is as long as
/// the `unit` that lengths are said in, and says which.
pub fn svg(places: &Places<'_>, dots: &[Dot], from: &[usize], unit: &Unit) -> String {
    let up = places.up;
    let cameras = || places.planned.iter().chain(places.kept);
    // As on a map: the second axis points up the page, and both with `up` are right-handed.
    let beside = if up.dot(DVec3::X).abs() < 0.9 { DVec3::X } else { DVec3::Y };
    let right = beside.reject_from_normalized(up).normalize();
    let north = up.cross(right);
    let flat = |p: DVec3| DVec2::new(p.dot(right), p.dot(north));
    let mut heights: Vec<f64> = cameras().map(|camera| camera.pose.position.dot(up)).collect();
    heights.sort_by(f64::total_cmp);
    let Some(ceiling) = heights.get(heights.len() * 9 / 10).copied() else { return String::new() };
    let below: Vec<&Dot> = dots.iter().filter(|dot| dot.position.dot(up) < ceiling).collect();
    let drawn: Vec<DVec2> = below.iter().map(|dot| flat(dot.position)).collect();
    let (mut low, mut high) = bulk(&drawn);
    for place in cameras().map(|camera| flat(camera.pose.position)) {
        (low, high) = (low.min(place), high.max(place));
    }
    let size = (high - low).max(DVec2::splat((1e-9 * (high - low).max_element()).max(1e-9)));
    let scale = (SIDE - 2.0 * BORDER) / size.max_element();
    let [width, height] = (scale * size + 2.0 * BORDER).to_array();
    let at = |p: DVec2| DVec2::new(BORDER + scale * (p.x - low.x), height - BORDER - scale * (p.y - low.y));
    let mut svg = format!(
        "<figure class=\"map\"><svg viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" aria-label=\"Where photos are taken, from above\">\n<g>"
    );
    for (dot, place) in below.iter().zip(&drawn).step_by(below.len().div_ceil(DOTS).max(1)) {
        if place.cmplt(low).any() || place.cmpgt(high).any() {
            continue;
        }
        let p = at(*place);
        let _ = write!(svg, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2\" fill=\"{}\"/>", p.x, p.y, dot.fill);
    }
    svg += "</g>\n";
    let arrow = |camera: &Camera, label: &str| {
        let (start, forward) = (at(flat(camera.pose.position)), flat(camera.pose.forward()));
        // Who looks down has a short arrow; y is down in the drawing.
        let end = start + ARROW * DVec2::new(forward.x, -forward.y);
        let text = match label {
            "" => String::new(),
            label => format!("<text x=\"{:.1}\" y=\"{:.1}\">{}</text>", start.x, start.y - 7.0, escape(label)),
        };
        format!(
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"3\"/><path d=\"M{:.1} {:.1}L{:.1} {:.1}\"/>{text}\n",
            start.x, start.y, start.x, start.y, end.x, end.y
        )
    };
    svg += "<g class=\"kept\">";
    for (index, camera) in cameras().enumerate().skip(places.planned.len()) {
        let name = if from.contains(&index) { stem(&camera.name).unwrap_or_default() } else { String::new() };
        svg += &arrow(camera, &name);
    }
    svg += "</g>\n<g class=\"planned\">";
    for (index, camera) in places.planned.iter().enumerate() {
        svg += &arrow(camera, &(index + 1).to_string());
    }
    let (x, y, length) = (BORDER, height - 0.5 * BORDER, scale * unit.length());
    let _ = write!(
        svg,
        "</g>\n<g class=\"bar\"><path d=\"M{x:.1} {y:.1}h{length:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
        x + 0.5 * length,
        y - 5.0,
        unit.name()
    );
    svg += "</g>\n</svg><figcaption>From above: numbers are the shots, names the photos to start from, lines where they look.</figcaption></figure>\n";
    svg
}

/// Bounds of places without the stray ones.
fn bulk(places: &[DVec2]) -> (DVec2, DVec2) {
    if places.is_empty() {
        return (DVec2::INFINITY, DVec2::NEG_INFINITY);
    }
    let bounds = [0, 1].map(|axis| {
        let mut sorted: Vec<f64> = places.iter().map(|p| p[axis]).collect();
        sorted.sort_by(f64::total_cmp);
        let aside = (STRAY * sorted.len() as f64) as usize;
        [sorted[aside], sorted[sorted.len() - 1 - aside]]
    });
    (DVec2::new(bounds[0][0], bounds[1][0]), DVec2::new(bounds[0][1], bounds[1][1]))
}
