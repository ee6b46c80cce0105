//! Small grey pictures, which frames are analysed on.

/// A grey picture: encoded values (sRGB, BT.709) row by row from the top left.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Grey {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// One value per pixel.
    pub values: Vec<u8>,
}

impl Grey {
    /// The luma of red, green and blue bytes side by side, weighted as in ITU-R BT.601, in which pictures are stored.
    pub fn of_colours(width: usize, height: usize, pixels: &[u8]) -> Self {
        let luma = |pixel: &[u8]| match *pixel {
            [r, g, b] => ((77 * u32::from(r) + 150 * u32::from(g) + 29 * u32::from(b) + 128) >> 8) as u8,
            _ => 0,
        };
        Self { width, height, values: pixels.chunks_exact(3).map(luma).collect() }
    }

    /// The value at a place within the picture.
    pub fn at(&self, x: usize, y: usize) -> i32 {
        i32::from(self.values[y * self.width + x])
    }

    /// The longer side in pixels.
    pub fn longer(&self) -> usize {
        self.width.max(self.height)
    }

    /// Each pixel is the mean of `factor` x `factor`; what is left over at the right and at the bottom is cut off.
    pub fn shrunk(&self, factor: usize) -> Self {
        if factor <= 1 {
            return self.clone();
        }
        let (width, height) = (self.width / factor, self.height / factor);
        let area = (factor * factor) as u32;
        let mut values = Vec::with_capacity(width * height);
        let mut sums = vec![0u32; width];
        for y in 0..height {
            sums.fill(0);
            for v in y * factor..(y + 1) * factor {
                let row = &self.values[v * self.width..][..width * factor];
                for (sum, block) in sums.iter_mut().zip(row.chunks_exact(factor)) {
                    *sum += block.iter().map(|value| u32::from(*value)).sum::<u32>();
                }
            }
            values.extend(sums.iter().map(|sum| ((sum + area / 2) / area) as u8));
        }
        Self { width, height, values }
    }

    /// Shrunk by the smallest whole factor with which the longer side has at most `side` pixels.
    pub fn within(&self, side: usize) -> Self {
        self.shrunk(self.longer().div_ceil(side.max(1)))
    }
}

#[cfg(test)]
pub(super) mod fixtures {
    use super::Grey;
    use crate::scene::random;

    /// Smooth noise in [0, 1] at any place: values on a lattice, blended with continuous slopes.
    fn noise(seed: u64, x: f64, y: f64) -> f64 {
        let lattice = |i: f64, j: f64| {
            let index = (i.rem_euclid(4096.0) as u32) << 12 | j.rem_euclid(4096.0) as u32;
            random::uniforms(seed, 7, index)[0]
        };
        let (i, j) = (x.floor(), y.floor());
        let ease = |t: f64| t * t * (3.0 - 2.0 * t);
        let (u, v) = (ease(x - i), ease(y - j));
        let row = |j: f64| (1.0 - u) * lattice(i, j) + u * lattice(i + 1.0, j);
        (1.0 - v) * row(j) + v * row(j + 1.0)
    }

    /// A textured plane without end, in grey values: slopes over 40 pixels, shapes of 12 pixels with edges a pixel or two wide, and grain of 4.
    pub fn plane(x: f64, y: f64) -> f64 {
        let of = |size: f64, seed: u64| noise(seed, x / size, y / size);
        let shape = (0.5 + 8.0 * (of(12.0, 2) - 0.5)).clamp(0.0, 1.0);
        8.0 + 80.0 * of(40.0, 1) + 110.0 * shape + 50.0 * of(4.0, 3)
    }

    /// A picture of what `value` has at each pixel, with even noise of `amount` grey values to either side, drawn by `seed`.
    pub fn picture([width, height]: [usize; 2], amount: f64, seed: u64, value: impl Fn(f64, f64) -> f64) -> Grey {
        let pixel = |i: usize| {
            let [u, ..] = random::uniforms(seed, 9, i as u32);
            let value = value((i % width) as f64, (i / width) as f64) + amount * (2.0 * u - 1.0);
            value.round().clamp(0.0, 255.0) as u8
        };
        Grey { width, height, values: (0..width * height).map(pixel).collect() }
    }

    /// The plane seen from `x`, `y`, smeared along x over `blur` pixels as by a shutter.
    pub fn view(size: [usize; 2], x: f64, y: f64, blur: f64) -> Grey {
        let samples = (2.0 * blur).ceil().max(1.0) as u32;
        picture(size, 0.0, 0, |u, v| {
            let offset = |i: u32| blur * ((f64::from(i) + 0.5) / f64::from(samples) - 0.5);
            (0..samples).map(|i| plane(u + x + offset(i), v + y)).sum::<f64>() / f64::from(samples)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, frames of a size that no factor divides would be analysed on shifted or darkened pictures.
    #[test]
    fn shrinking_takes_means_and_cuts_what_is_left_over() {
        let picture = Grey { width: 5, height: 3, values: vec![0, 10, 20, 30, 99, 20, 30, 40, 50, 99, 9, 9, 9, 9, 9] };
        assert_eq!(picture.shrunk(2), Grey { width: 2, height: 1, values: vec![15, 35] });
        assert_eq!(picture.within(5), picture);
        assert_eq!(picture.within(3).width, 2);
    }

    /// If this failed, colours would weigh otherwise in a folder of pictures than in a video.
    #[test]
    fn luma_of_grey_is_that_grey() {
        let grey = Grey::of_colours(3, 1, &[0, 0, 0, 128, 128, 128, 255, 255, 255]);
        assert_eq!(grey.values, [0, 128, 255]);
        assert_eq!(Grey::of_colours(1, 1, &[255, 0, 0]).values, [77]);
    }
}
