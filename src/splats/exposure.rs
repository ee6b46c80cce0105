//! How photos were exposed and balanced, beside what the splats say of the scene: an affine map of colours for each, in sRGB as pictures
//! are blended (after the exposure compensation of 3D Gaussian splatting's code, 2024). Twin of `splats/exposure.glsl`.

use glam::{DMat3, DMat4, DVec3, DVec4};

/// The map of a photo: what splats show before the background, c, and what is left of the light behind them, T, make
/// `matrix * c + (1 - T) offset + T background`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Gains and mixtures of the channels.
    pub matrix: DMat3,
    /// What is added where splats are.
    pub offset: DVec3,
}

/// Weight of no change in a fit, against the pixels: a half of a picture may show one colour only.
const RIDGE: f64 = 1e-4;

impl Exposure {
    /// The map that changes nothing.
    pub const NONE: Self = Self { matrix: DMat3::IDENTITY, offset: DVec3::ZERO };

    /// From numbers as the device keeps them: the matrix without the unit matrix and the offset, row by row.
    pub fn from_device(value: &[f32]) -> Self {
        let at = |row: usize, column: usize| f64::from(value.get(4 * row + column).copied().unwrap_or_default());
        let column = |k: usize| DVec3::new(at(0, k), at(1, k), at(2, k));
        Self { matrix: DMat3::IDENTITY + DMat3::from_cols(column(0), column(1), column(2)), offset: column(3) }
    }

    /// A pixel as the photo shows it, of a drawn one that is over the background already.
    pub fn shown(&self, drawn: DVec3, left: f64, background: DVec3) -> DVec3 {
        self.matrix * (drawn - left * background) + (1.0 - left) * self.offset + left * background
    }

    /// The gradient by what splats show of that by the pixel as it is shown, and by matrix (by rows) and offset.
    pub fn gradient(&self, drawn: DVec3, left: f64, background: DVec3, by_shown: DVec3) -> (DVec3, [DVec4; 3]) {
        let own = (drawn - left * background).extend(1.0 - left);
        (self.matrix.transpose() * by_shown, [by_shown.x * own, by_shown.y * own, by_shown.z * own])
    }

    /// The picture that the backward pass reads, and the background that it is over: with these, what is left of the light counts as it
    /// does in the picture that is shown.
    pub fn for_backward(&self, drawn: DVec3, left: f64, background: DVec3) -> DVec3 {
        drawn - left * background + left * (self.matrix.inverse() * (background - self.offset))
    }

    /// The map that makes drawn pixels most like others, by least squares: pixels over the background, what is left of the light, and
    /// what the photo shows.
    pub fn fit(pixels: impl Iterator<Item = (DVec3, f64, DVec3)>, background: DVec3) -> Self {
        let mut squares = DMat4::ZERO;
        let mut products = [DVec4::ZERO; 3];
        let mut count = 0.0;
        for (drawn, left, photo) in pixels {
            let own = (drawn - left * background).extend(1.0 - left);
            squares += DMat4::from_cols(own.x * own, own.y * own, own.z * own, own.w * own);
            let wanted = photo - left * background;
            products.iter_mut().zip(wanted.to_array()).for_each(|(sum, wanted)| *sum += wanted * own);
            count += 1.0;
        }
        if count == 0.0 {
            return Self::NONE;
        }
        let weight = RIDGE * count;
        let back = (squares + weight * DMat4::IDENTITY).inverse();
        let rows =
            [DVec4::X, DVec4::Y, DVec4::Z].into_iter().zip(products).map(|(unit, sum)| back * (sum + weight * unit));
        let rows: Vec<DVec4> = rows.collect();
        Self {
            matrix: DMat3::from_cols(rows[0].truncate(), rows[1].truncate(), rows[2].truncate()).transpose(),
            offset: DVec3::new(rows[0].w, rows[1].w, rows[2].w),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> Exposure {
        let matrix =
            DMat3::from_cols(DVec3::new(1.2, 0.03, -0.02), DVec3::new(-0.05, 0.9, 0.04), DVec3::new(0.01, 0.02, 1.1));
        Exposure { matrix, offset: DVec3::new(0.02, -0.03, 0.05) }
    }

    /// If this failed, exposures would be learnt along another slope than the loss has, or splats pay for what a photo's exposure is.
    #[test]
    fn gradients_are_those_of_the_picture() {
        let (exposure, background) = (some(), DVec3::new(0.3, 0.6, 0.1));
        let (own, left, by_shown) = (DVec3::new(0.2, 0.4, 0.3), 0.35, DVec3::new(0.7, -0.4, 0.2));
        let value = |exposure: &Exposure, own: DVec3, left: f64| {
            by_shown.dot(exposure.shown(own + left * background, left, background))
        };
        let (by_own, by_rows) = exposure.gradient(own + left * background, left, background, by_shown);
        let h = 1e-6;
        for axis in 0..3 {
            let step = h * DVec3::AXES[axis];
            let slope = (value(&exposure, own + step, left) - value(&exposure, own - step, left)) / (2.0 * h);
            assert!((slope - by_own[axis]).abs() < 1e-8, "by own, {axis}");
            for (column, found) in by_rows[axis].to_array().into_iter().enumerate() {
                let moved = |by: f64| {
                    let mut moved = exposure;
                    match column {
                        3 => moved.offset[axis] += by,
                        _ => moved.matrix.col_mut(column)[axis] += by,
                    }
                    value(&moved, own, left)
                };
                let slope = (moved(h) - moved(-h)) / (2.0 * h);
                assert!((slope - found).abs() < 1e-8, "by row {axis}, column {column}");
            }
        }
        // The backward pass takes dx/dT from the picture: (x . g) grows by what is left of the light as the shown picture does.
        let drawn = |left: f64| exposure.for_backward(own + left * background, left, background);
        let slope = (value(&exposure, own, left + h) - value(&exposure, own, left - h)) / (2.0 * h);
        let found = by_own.dot(drawn(left + h) - drawn(left - h)) / (2.0 * h);
        assert!((slope - found).abs() < 1e-7, "{slope} and {found}");
    }

    /// If this failed, test views would be compared under another exposure than their photos have.
    #[test]
    fn a_fit_finds_the_exposure_of_a_photo() {
        let (exposure, background) = (some(), DVec3::new(0.3, 0.6, 0.1));
        let pixels = (1..500).map(|i| {
            let value = |k: u32| 0.5 + 0.5 * (f64::from(i) * (0.61 + 0.37 * f64::from(k))).sin();
            let (own, left) = (0.8 * DVec3::new(value(0), value(1), value(2)), 0.2 * value(3));
            let drawn = own + left * background;
            (drawn, left, exposure.shown(drawn, left, background))
        });
        let found = Exposure::fit(pixels, background);
        assert!(
            found.matrix.abs_diff_eq(exposure.matrix, 0.02) && found.offset.abs_diff_eq(exposure.offset, 0.02),
            "{found:?}"
        );
        // Of one colour nothing but that is learnt.
        let plain = Exposure::fit((0..100).map(|_| (DVec3::ZERO, 1.0, DVec3::ZERO)), DVec3::ZERO);
        assert!(plain.matrix.abs_diff_eq(DMat3::IDENTITY, 1e-9) && plain.offset.length() < 1e-9, "{plain:?}");
        assert_eq!(Exposure::fit(std::iter::empty(), background), Exposure::NONE);
    }

    /// If this failed, what was learnt would be written with rows for columns.
    #[test]
    fn numbers_of_the_device_go_by_rows() {
        let value = [0.2, 0.1, 0.0, 0.5, -0.3, 0.0, 0.0, 0.6, 0.0, 0.0, 0.1, 0.7f32];
        let exposure = Exposure::from_device(&value);
        let shown = exposure.shown(DVec3::new(1.0, 2.0, 4.0), 0.0, DVec3::ZERO);
        assert!(shown.abs_diff_eq(DVec3::new(1.2 + 0.2 + 0.5, 2.0 - 0.3 + 0.6, 4.4 + 0.7), 1e-6), "{shown}");
    }
}
