//! A photo as the device samples it: luma of linear RGB and mask, in levels that halve in size.

/// Most texels of the finest level; larger photos begin at a coarser one. It keeps a pyramid within 90 MB.
pub(crate) const MAX_TEXELS: u64 = 1 << 24;

/// Luma times mask (low half) and mask (high half) of each texel, 16 bits each.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pyramid {
    /// Texels of the finest level along a row.
    pub width: u32,
    /// Rows of the finest level.
    pub height: u32,
    /// Levels; the coarsest is one texel.
    pub levels: u32,
    /// Level after level, the finest first, row by row.
    pub texels: Vec<u32>,
}

/// Texels of a level half as large.
const fn halved(size: u32) -> u32 {
    size.div_ceil(2)
}

impl Pyramid {
    /// The pyramid of a photo's luma (linear, in [0, 1]), row by row; a mask of the same size is white where the object
    /// is.
    pub fn new(width: u32, height: u32, luma: &[f32], mask: Option<&[u8]>) -> Self {
        let texel = |luma: f32, mask: u8| {
            let mask = 257 * u32::from(mask);
            (mask << 16) | (luma * mask as f32 + 0.5) as u32
        };
        let texels = match mask {
            None => luma.iter().map(|luma| texel(*luma, 255)).collect(),
            Some(mask) => luma.iter().zip(mask).map(|(luma, mask)| texel(*luma, *mask)).collect(),
        };
        let mut pyramid = Self { width, height, levels: 1, texels };
        let (mut width, mut height, mut start) = (width, height, 0);
        while width > 1 || height > 1 {
            let next = pyramid.texels.len();
            pyramid.halve(start, width, height);
            if u64::from(width) * u64::from(height) > MAX_TEXELS {
                pyramid.texels.drain(..next);
                (pyramid.width, pyramid.height) = (halved(width), halved(height));
            } else {
                pyramid.levels += 1;
                start = next;
            }
            (width, height) = (halved(width), halved(height));
        }
        pyramid
    }

    /// Texels that the pyramid of an image of this size has.
    pub fn size(width: u32, height: u32) -> u64 {
        let (mut width, mut height, mut sum) = (width.max(1), height.max(1), 0);
        loop {
            let texels = u64::from(width) * u64::from(height);
            sum += if texels > MAX_TEXELS { 0 } else { texels };
            if texels == 1 {
                return sum;
            }
            (width, height) = (halved(width), halved(height));
        }
    }

    /// Appends the level below the one that starts at `start`: means over two by two texels, or what there is of them.
    fn halve(&mut self, start: usize, width: u32, height: u32) {
        let (width, height) = (width as usize, height as usize);
        self.texels.reserve(width.div_ceil(2) * height.div_ceil(2));
        for y in (0..height).step_by(2) {
            let below = if y + 1 < height { width } else { 0 };
            for x in (0..width).step_by(2) {
                let at = start + y * width + x;
                let beside = usize::from(x + 1 < width);
                let [mut luma, mut mask] = [2u32; 2];
                for texel in [at, at + beside, at + below, at + below + beside].map(|i| self.texels[i]) {
                    luma += texel & 0xffff;
                    mask += texel >> 16;
                }
                self.texels.push(((mask / 4) << 16) | (luma / 4));
            }
        }
    }

    /// Luma times mask, and mask, of a texel of a level that starts at `offset`; the nearest one outside.
    fn texel(&self, offset: usize, [width, height]: [u32; 2], x: i32, y: i32) -> [f32; 2] {
        let inside = |at: i32, size: u32| at.clamp(0, size as i32 - 1) as usize;
        let texel = self.texels[offset + inside(y, height) * width as usize + inside(x, width)];
        [(texel & 0xffff) as f32 / 65535.0, (texel >> 16) as f32 / 65535.0]
    }

    /// Luma times mask, and mask, at `pixel` of the finest level, between the four nearest texels of a level: the twin
    /// of `bilinear` in `observe.comp`.
    pub fn bilinear(&self, level: u32, pixel: [f32; 2]) -> [f32; 2] {
        let (mut offset, mut size) = (0, [self.width, self.height]);
        for _ in 0..level {
            offset += size[0] as usize * size[1] as usize;
            size = size.map(halved);
        }
        let at = pixel.map(|v| v / (1u32 << level) as f32 - 0.5);
        let corner = at.map(|v| v.floor() as i32);
        let part = at.map(|v| v - v.floor());
        let mix = |a: [f32; 2], b: [f32; 2], t: f32| [0, 1].map(|i| a[i] + t * (b[i] - a[i]));
        let row = |y: i32| {
            let [left, right] = [0, 1].map(|x| self.texel(offset, size, corner[0] + x, corner[1] + y));
            mix(left, right, part[0])
        };
        mix(row(0), row(1), part[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, intensities would be off, or a photo of odd size would be read past its end.
    #[test]
    fn every_level_keeps_the_mean() {
        let stripes: Vec<f32> = (0..16).map(|i| (i % 2) as f32).collect();
        let pyramid = Pyramid::new(4, 4, &stripes, None);
        assert_eq!((pyramid.levels, pyramid.texels.len()), (3, 16 + 4 + 1));
        let [luma, mask] = pyramid.bilinear(2, [2.0, 2.0]);
        assert!((luma - 0.5).abs() < 1e-4 && mask == 1.0, "{luma}, {mask}");
        for (width, height) in [(1, 1), (5, 3), (1, 7), (912, 911)] {
            let pyramid = Pyramid::new(width, height, &vec![0.3; (width * height) as usize], None);
            assert_eq!(pyramid.texels.len() as u64, Pyramid::size(width, height), "{width} x {height}");
            let coarsest = pyramid.bilinear(pyramid.levels - 1, [0.5; 2]);
            assert!((coarsest[0] - 0.3).abs() < 1e-4, "{coarsest:?}");
        }
    }

    /// If this failed, the background would shine into what is seen of the object.
    #[test]
    fn what_the_mask_hides_has_no_say() {
        let pyramid = Pyramid::new(2, 2, &[0.7, 0.1, 0.7, 0.1], Some(&[255, 0, 255, 0]));
        let [luma, mask] = pyramid.bilinear(1, [1.0, 1.0]);
        assert!((luma / mask - 0.7).abs() < 1e-4 && (mask - 0.5).abs() < 1e-4);
    }

    /// If this failed, one huge photo would not fit a device's buffer.
    #[test]
    fn huge_photos_begin_at_a_coarser_level() {
        let (width, height) = (8192, 4096);
        let pyramid = Pyramid::new(width, height, &vec![0.2; (width * height) as usize], None);
        assert_eq!((pyramid.width, pyramid.height), (4096, 2048));
        assert_eq!(pyramid.texels.len() as u64, Pyramid::size(width, height));
    }
}
