//! The loss of Kerbl et al. (2023), 0.8 L1 + 0.2 (1 - SSIM), and its gradient; SSIM after Wang et al. (2004).

use crate::engine::vulkan::shaders::glsl::splats::photo;

use glam::DVec3;

/// Weight of the dissimilarity; the rest is the mean absolute difference's.
const DISSIMILARITY: f64 = 0.2;
/// Pixels on either side of a window's centre.
const REACH: usize = photo::RADIUS as usize;
/// Standard deviation of the window's weights in pixels.
const SIGMA: f64 = 1.5;
const C1: f64 = photo::C1;
const C2: f64 = photo::C2;

/// Loss of a picture (values in [0, 1], row by row) against what it should be, and the gradient by every pixel.
///
/// Unknown pixels of the target are `None`: picture and target count as 0 there, and the gradient is 0. Means are over all
/// pixels and channels. Outside of the picture both are 0.
pub fn loss(picture: &[DVec3], target: &[Option<DVec3>], width: usize, height: usize) -> (f64, Vec<DVec3>) {
    let mut loss = 0.0;
    let mut gradient = vec![DVec3::ZERO; picture.len()];
    let weight = 1.0 / (3 * width * height) as f64;
    for channel in 0..3 {
        let x: Vec<f64> = picture.iter().zip(target).map(|(x, y)| y.map_or(0.0, |_| x[channel])).collect();
        let y: Vec<f64> = target.iter().map(|y| y.map_or(0.0, |y| y[channel])).collect();
        let (similarity, by_similarity) = ssim(&x, &y, width, height);
        let apart: f64 = x.iter().zip(&y).map(|(x, y)| (x - y).abs()).sum();
        loss += weight * ((1.0 - DISSIMILARITY) * apart - DISSIMILARITY * similarity.iter().sum::<f64>());
        for i in (0..picture.len()).filter(|i| target[*i].is_some()) {
            let sign = f64::from(i8::from(x[i] > y[i]) - i8::from(x[i] < y[i]));
            gradient[i][channel] = weight * ((1.0 - DISSIMILARITY) * sign - DISSIMILARITY * by_similarity[i]);
        }
    }
    (loss + DISSIMILARITY, gradient)
}

/// Structural similarity of two channels about every pixel, and the gradient of its sum by every value of the first.
pub fn ssim(x: &[f64], y: &[f64], width: usize, height: usize) -> (Vec<f64>, Vec<f64>) {
    let blurred = |values: Vec<f64>| blur(&values, width, height);
    let products = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).collect();
    let (mean_x, mean_y) = (blurred(x.to_vec()), blurred(y.to_vec()));
    let (xx, yy, xy) = (blurred(products(x, x)), blurred(products(y, y)), blurred(products(x, y)));
    let mut similarity = Vec::with_capacity(x.len());
    // Gradients by the blurred x, x^2 and x y at each window.
    let (mut by_mean, mut by_xx, mut by_xy) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..x.len() {
        let (mx, my) = (mean_x[i], mean_y[i]);
        let means = 2.0 * mx * my + C1;
        let covariances = 2.0 * (xy[i] - mx * my) + C2;
        let squares = mx * mx + my * my + C1;
        let variances = (xx[i] - mx * mx) + (yy[i] - my * my) + C2;
        let s = means * covariances / (squares * variances);
        let by_variance = -s / variances;
        let by_covariance = 2.0 * means / (squares * variances);
        similarity.push(s);
        by_xx.push(by_variance);
        by_xy.push(by_covariance);
        by_mean.push(
            2.0 * my * covariances / (squares * variances)
                - 2.0 * mx * s / squares
                - 2.0 * mx * by_variance
                - my * by_covariance,
        );
    }
    // The window is symmetric and what is outside counts as 0, so that blurring is its own transpose.
    let (by_mean, by_xx, by_xy) = (blurred(by_mean), blurred(by_xx), blurred(by_xy));
    let gradient = (0..x.len()).map(|i| by_mean[i] + 2.0 * x[i] * by_xx[i] + y[i] * by_xy[i]).collect();
    (similarity, gradient)
}

/// Weighted means over the window about each pixel; values outside are 0.
fn blur(values: &[f64], width: usize, height: usize) -> Vec<f64> {
    let weights = window();
    let along = |values: &[f64], length: usize, step: usize, i: usize, at: usize| -> f64 {
        let first = at.saturating_sub(REACH);
        (first..length.min(at + REACH + 1)).map(|k| weights[k + REACH - at] * values[i + k * step - at * step]).sum()
    };
    let rows: Vec<f64> = (0..values.len()).map(|i| along(values, width, 1, i, i % width)).collect();
    (0..values.len()).map(|i| along(&rows, height, width, i, i / width)).collect()
}

/// Weights of the window along a line, with the sum 1.
fn window() -> [f64; 2 * REACH + 1] {
    let weights: [f64; 2 * REACH + 1] = std::array::from_fn(|k| {
        let d = k as f64 - REACH as f64;
        (-0.5 * d * d / (SIGMA * SIGMA)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random::uniforms;

    fn picture(seed: u64, pixels: usize) -> Vec<DVec3> {
        (0..pixels as u32).map(|i| DVec3::from_slice(&uniforms(seed, 0, i)[..3])).collect()
    }

    /// SSIM as it is defined: all weights of the window in two dimensions, covariances as means of products of deviations.
    /// If this failed, the trainer would chase, and report, another measure than other trainers.
    #[test]
    fn similarity_is_what_its_definition_says() {
        for (width, height) in [(14, 13), (5, 3), (1, 1), (12, 2)] {
            let value = |seed| picture(seed, width * height).iter().map(|p| p.x).collect::<Vec<f64>>();
            let (x, y) = (value(1), value(2));
            let (similarity, _) = ssim(&x, &y, width, height);
            let weight = |i: isize, j: isize| (-((i * i + j * j) as f64) / 4.5).exp();
            let whole: f64 = (-5..=5).flat_map(|j| (-5..=5).map(move |i| weight(i, j))).sum();
            for (at, found) in similarity.iter().enumerate() {
                let mean = |value: &dyn Fn(f64, f64) -> f64| {
                    let mut sum = 0.0;
                    for (j, i) in (-5..=5).flat_map(|j| (-5..=5).map(move |i| (j, i))) {
                        let (column, row) = ((at % width) as isize + i, (at / width) as isize + j);
                        let inside = (0..width as isize).contains(&column) && (0..height as isize).contains(&row);
                        let k = (row * width as isize + column) as usize;
                        sum += weight(i, j) / whole * if inside { value(x[k], y[k]) } else { value(0.0, 0.0) };
                    }
                    sum
                };
                let (mx, my) = (mean(&|x, _| x), mean(&|_, y| y));
                let (vx, vy) = (mean(&|x, _| (x - mx).powi(2)), mean(&|_, y| (y - my).powi(2)));
                let covariance = mean(&|x, y| (x - mx) * (y - my));
                let expected = (2.0 * mx * my + 1e-4) * (2.0 * covariance + 9e-4)
                    / ((mx * mx + my * my + 1e-4) * (vx + vy + 9e-4));
                assert!((found - expected).abs() < 1e-12, "{width} x {height}, {at}: {found} for {expected}");
            }
        }
    }

    /// If this failed, the parts of the loss would have other weights or edges: the middle of even pictures sees no edge, so
    /// that SSIM there is that of the means alone; equal pictures lose nothing.
    #[test]
    fn even_pictures_have_the_loss_of_their_means() {
        let (a, b) = (0.3, 0.7);
        let (similarity, _) = ssim(&[a; 225], &[b; 225], 15, 15);
        let expected = (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4);
        assert!((similarity[7 * 15 + 7] - expected).abs() < 1e-12, "{} for {expected}", similarity[112]);
        let image = picture(3, 60);
        let known: Vec<_> = image.iter().copied().map(Some).collect();
        let (same, gradient) = loss(&image, &known, 10, 6);
        assert!(same.abs() < 1e-15 && gradient.iter().all(|g| g.length() < 1e-15), "{same}");
        let flat = [DVec3::splat(a); 225];
        let (found, _) = loss(&flat, &[Some(DVec3::splat(b)); 225], 15, 15);
        let mean = similarity.iter().sum::<f64>() / 225.0;
        assert!((found - (0.8 * 0.4 + 0.2 * (1.0 - mean))).abs() < 1e-12);
    }

    /// If this failed, the picture would be pulled the wrong way; sizes are odd, and smaller than the window.
    #[test]
    fn gradients_are_those_of_differences() {
        for (width, height) in [(13, 9), (7, 3), (1, 5), (1, 1)] {
            let image = picture(4, width * height);
            for unknown in [0, 3] {
                let target: Vec<Option<DVec3>> = picture(5, width * height)
                    .into_iter()
                    .enumerate()
                    .map(|(i, y)| (unknown == 0 || i % unknown != 1).then_some(y))
                    .collect();
                let (_, gradient) = loss(&image, &target, width, height);
                for at in 0..image.len() {
                    for channel in 0..3 {
                        let moved = |by: f64| {
                            let mut image = image.clone();
                            image[at][channel] += by;
                            loss(&image, &target, width, height).0
                        };
                        let h = 1e-4;
                        let wide = moved(2.0 * h) - moved(-2.0 * h);
                        let difference = (8.0 * (moved(h) - moved(-h)) - wide) / (12.0 * h);
                        let found = gradient[at][channel];
                        assert!(
                            (found - difference).abs() < 1e-7 * difference.abs() + 1e-10,
                            "{width} x {height}, pixel {at}: {found} for {difference}"
                        );
                    }
                }
            }
        }
    }

    /// If this failed, pixels that a mask leaves out would still be trained on.
    #[test]
    fn unknown_pixels_have_no_say() {
        let mut image = picture(6, 35);
        let target: Vec<_> = picture(7, 35).into_iter().enumerate().map(|(i, y)| (i != 17).then_some(y)).collect();
        let (before, gradient) = loss(&image, &target, 7, 5);
        assert_eq!(gradient[17], DVec3::ZERO);
        image[17] = DVec3::splat(0.9);
        assert_eq!(loss(&image, &target, 7, 5), (before, gradient));
        let (nothing, _) = loss(&image, &[None; 35], 7, 5);
        assert!(nothing.abs() < 1e-15, "{nothing}");
    }
}
