//! Structural similarity (Wang et al. 2004, "Image Quality Assessment: From Error Visibility to Structural Similarity").

use super::Rgb8;
use crate::engine::parallel::with_scratch;
use crate::{Error, Result};

/// Pixels along a side of the window, and so the fewest that an image may have.
pub const SSIM_WINDOW: u32 = 11;
const WINDOW: usize = SSIM_WINDOW as usize;
/// Standard deviation of the window in pixels.
const SIGMA: f64 = 1.5;
/// What keeps the ratios finite: (0.01 · 255)² and (0.03 · 255)².
const C1: f64 = 6.5025;
const C2: f64 = 58.5225;

/// Mean structural similarity: a Gaussian window of 11 x 11 pixels over each channel, wherever it lies inside the image.
///
/// # Errors
/// Where the images differ in size, or a side has fewer than [`SSIM_WINDOW`] pixels.
pub fn ssim(a: &Rgb8, b: &Rgb8) -> Result<f64> {
    a.check_size(b)?;
    let (width, height) = (a.width as usize, a.height as usize);
    if width.min(height) < WINDOW {
        let what =
            format!("SSIM needs {WINDOW} pixels a side and the images have {width} x {height}; compare larger ones");
        return Err(Error::request(what));
    }
    let window = window();
    // Each row of windows has one writer, and rows are summed in order, so threads change nothing.
    let mut rows = vec![0.0; height - WINDOW + 1];
    let scratch = || vec![[0.0; 5]; 3 * width];
    with_scratch(&mut rows, 1, scratch, |y, row, columns| row[0] = similarity(a, b, y, &window, columns));
    Ok(rows.iter().sum::<f64>() / (3 * (width - WINDOW + 1) * rows.len()) as f64)
}

/// The Gaussian, which sums to one.
fn window() -> [f64; WINDOW] {
    let weights: [f64; WINDOW] = std::array::from_fn(|i| {
        let distance = i as f64 - (WINDOW / 2) as f64;
        (-0.5 * (distance / SIGMA).powi(2)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// Similarity summed over the windows whose first row is `y`, and over channels. `columns` is scratch: for each column and
/// channel the window's means, down the column, of a, b, a², b² and ab.
fn similarity(a: &Rgb8, b: &Rgb8, y: usize, window: &[f64; WINDOW], columns: &mut [[f64; 5]]) -> f64 {
    columns.fill([0.0; 5]);
    let rows = a.pixels.chunks_exact(columns.len()).zip(b.pixels.chunks_exact(columns.len()));
    for (weight, (a, b)) in window.iter().zip(rows.skip(y)) {
        for (sums, (a, b)) in columns.iter_mut().zip(a.iter().zip(b)) {
            let (a, b) = (f64::from(*a), f64::from(*b));
            for (sum, value) in sums.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                *sum += weight * value;
            }
        }
    }
    let first = 0..columns.len() - 3 * (WINDOW - 1);
    first
        .map(|first| {
            let mut means = [0.0; 5];
            for (weight, sums) in window.iter().zip(columns[first..].iter().step_by(3)) {
                for (mean, sum) in means.iter_mut().zip(sums) {
                    *mean += weight * sum;
                }
            }
            let [a, b, aa, bb, ab] = means;
            let (variances, covariance) = (aa - a * a + bb - b * b, ab - a * b);
            (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (variances + C2))
        })
        .sum()
}
