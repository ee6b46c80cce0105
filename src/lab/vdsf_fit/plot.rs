//! The plot of a fit: points, coloured by roughness, and the curve.

use std::fmt::Write as _;

use super::{Observation, most_views};
use crate::photogrammetry::vds::vdsf::Vdsf;

/// Size of the picture and the frame in it: left, top, right, bottom.
const SIZE: [f64; 2] = [1000.0, 700.0];
const FRAME: [f64; 4] = [90.0, 60.0, 850.0, 620.0];

/// Colours of roughness 0, 1/2 and 1.
const COLOURS: [[f64; 3]; 3] = [[0.0, 60.0, 190.0], [20.0, 160.0, 110.0], [240.0, 150.0, 20.0]];

/// The axis of deviations ends at this many times that of the fitted range; points beyond are drawn at its end.
const BEYOND: f64 = 1.4;

/// An SVG picture: across the standard deviation of the luma, with variances written at the ticks; upwards the views over
/// the hemisphere, logarithmic.
pub fn svg(vdsf: &Vdsf, observations: &[Observation]) -> String {
    let [left, top, right, bottom] = FRAME;
    let most = vdsf.range[1].sqrt() * BEYOND;
    let x = |variance: f64| left + (right - left) * (variance.sqrt() / most).min(1.0);
    let y = |score: f64| bottom - (bottom - top) * score;
    let [width, height] = SIZE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"15\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    let mut add = |line: String| {
        svg.push_str(&line);
        svg.push('\n');
    };
    let middle = 0.5 * (left + right);
    add(format!(
        "<text x=\"{middle}\" y=\"35\" text-anchor=\"middle\" font-size=\"18\">View dependency score function: {} samples, \
         R² {:.2}, Spearman {:.2}</text>",
        observations.len(),
        vdsf.quality.r_squared,
        vdsf.quality.spearman
    ));
    for deviation in (0..).map(|i| 0.05 * f64::from(i)).take_while(|deviation| *deviation <= most) {
        let at = x(deviation * deviation);
        add(format!("<line x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{bottom}\" stroke=\"#ddd\"/>"));
        add(format!(
            "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{:.4}</text>",
            bottom + 22.0,
            deviation * deviation
        ));
    }
    for views in [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0] {
        let at = y(libm::log(views) / libm::log(most_views()));
        add(format!("<line x1=\"{left}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\" stroke=\"#ddd\"/>"));
        add(format!("<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{views}</text>", left - 10.0, at + 5.0));
    }
    add(format!(
        "<rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#444\"/>",
        right - left,
        bottom - top
    ));
    add(format!(
        "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">variance of luma over 5 to 15 views (axis linear in its \
         square root)</text>",
        bottom + 55.0
    ));
    let centre = 0.5 * (top + bottom);
    add(format!(
        "<text transform=\"translate(30 {centre}) rotate(-90)\" text-anchor=\"middle\">views over the hemisphere for an \
         error of {}</text>",
        vdsf.epsilon
    ));
    for seen in observations {
        add(format!(
            "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.5\" fill=\"{}\" fill-opacity=\"0.7\"/>",
            x(seen.variance),
            y(seen.score()),
            colour(seen.roughness)
        ));
    }
    let mut path = String::new();
    for i in 0..=200 {
        let deviation = most * f64::from(i) / 200.0;
        let variance = deviation * deviation;
        // Writing to a string cannot fail.
        let _ = write!(path, "{}{:.1} {:.1}", if i == 0 { "M" } else { "L" }, x(variance), y(vdsf.apply(variance)));
    }
    add(format!("<path d=\"{path}\" fill=\"none\" stroke=\"#c00020\" stroke-width=\"3.5\"/>"));
    legend(&mut add);
    svg + "</svg>\n"
}

/// The bar of colours to the right.
fn legend(add: &mut impl FnMut(String)) {
    let [_, top, right, _] = FRAME;
    let (at, height, steps) = (right + 30.0, 200.0, 20);
    add(format!("<text x=\"{at}\" y=\"{}\">roughness</text>", top + 12.0));
    for step in 0..steps {
        let roughness = (f64::from(step) + 0.5) / f64::from(steps);
        let each = height / f64::from(steps);
        let y = top + 25.0 + height - each * f64::from(step + 1);
        add(format!(
            "<rect x=\"{at}\" y=\"{y}\" width=\"20\" height=\"{}\" fill=\"{}\"/>",
            each + 0.5,
            colour(roughness)
        ));
    }
    for tenths in [0, 5, 10] {
        let y = top + 25.0 + height * (1.0 - f64::from(tenths) / 10.0) + 5.0;
        add(format!("<text x=\"{}\" y=\"{y}\">{}</text>", at + 28.0, f64::from(tenths) / 10.0));
    }
    let y = top + 270.0;
    add(format!("<path d=\"M{at} {y}h20\" stroke=\"#c00020\" stroke-width=\"3.5\"/>"));
    add(format!("<text x=\"{}\" y=\"{}\">the cubic</text>", at + 28.0, y + 5.0));
}

/// The colour of a roughness in [0, 1].
fn colour(roughness: f64) -> String {
    let at = 2.0 * roughness.clamp(0.0, 1.0);
    let (from, to, share) = if at < 1.0 { (COLOURS[0], COLOURS[1], at) } else { (COLOURS[1], COLOURS[2], at - 1.0) };
    let channel = |i: usize| (from[i] + (to[i] - from[i]) * share).round();
    format!("rgb({},{},{})", channel(0), channel(1), channel(2))
}
