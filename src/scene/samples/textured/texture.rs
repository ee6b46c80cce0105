//! The textures by name: how large they are, what they show, and their making.

use glam::Vec3;

use super::{cloth, nature, paintings, print, walls, wood};
use crate::engine::parallel::in_parallel;
use crate::scene::model::Image;

/// A texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Texture {
    /// Planks of a floor, along u.
    Planks,
    /// Boards of furniture, fibres along u; pale.
    Wood,
    /// Brushed paint; almost white.
    Paint,
    /// Plaster; almost white.
    Plaster,
    /// Wallpaper with twigs that grow towards the top.
    Wallpaper,
    /// Speckled stoneware; pale.
    Stoneware,
    /// Woven cloth; pale.
    Weave,
    /// Bed linen with stripes.
    Linen,
    /// A knotted rug, shown once.
    Rug,
    /// A long-haired rug, shown once.
    Wool,
    /// Spines of books, see [`Texture::cell`].
    Spines,
    /// The cut side of pages along u.
    Paper,
    /// What a screen shows.
    Screen,
    /// Pictures, see [`Texture::cell`].
    Pictures,
    /// The view from a window.
    Garden,
    /// A leaf along u.
    Leaf,
    /// Skin of fruit; pale.
    Skin,
    /// Four sides of cartons, see [`Texture::cell`].
    Cardboard,
}

impl Texture {
    /// All of them.
    #[cfg(test)]
    pub const ALL: [Self; 18] = [
        Self::Planks,
        Self::Wood,
        Self::Paint,
        Self::Plaster,
        Self::Wallpaper,
        Self::Stoneware,
        Self::Weave,
        Self::Linen,
        Self::Rug,
        Self::Wool,
        Self::Spines,
        Self::Paper,
        Self::Screen,
        Self::Pictures,
        Self::Garden,
        Self::Leaf,
        Self::Skin,
        Self::Cardboard,
    ];

    /// Columns and rows of its image.
    pub fn size(self) -> [u32; 2] {
        match self {
            Self::Planks | Self::Pictures => [1024, 1024],
            Self::Plaster => [640, 640],
            Self::Rug => [1024, 768],
            Self::Garden | Self::Spines => [1024, 512],
            Self::Wood | Self::Weave => [512, 512],
            Self::Linen | Self::Wallpaper => [448, 448],
            Self::Screen => [512, 288],
            Self::Wool => [384, 512],
            Self::Cardboard => [768, 768],
            Self::Paint | Self::Stoneware | Self::Paper | Self::Leaf | Self::Skin => [256, 256],
        }
    }

    /// Metres that it is wide and high where it repeats; ones that are shown in pieces or once are stretched instead.
    pub fn span(self) -> [f64; 2] {
        match self {
            Self::Planks => [2.4, 2.4],
            Self::Plaster => [1.9, 1.9],
            Self::Wood => [1.2, 0.6],
            Self::Paint => [0.9, 0.9],
            Self::Wallpaper => [0.9, 0.9],
            Self::Weave => [0.45, 0.45],
            Self::Linen => [0.9, 0.9],
            Self::Stoneware => [0.4, 0.4],
            Self::Paper => [0.3, 0.15],
            Self::Skin => [0.25, 0.25],
            Self::Rug
            | Self::Wool
            | Self::Spines
            | Self::Screen
            | Self::Pictures
            | Self::Garden
            | Self::Leaf
            | Self::Cardboard => [1.0, 1.0],
        }
    }

    /// A piece of one that has several things side by side: left, top, right and bottom texture coordinate, a little within the piece,
    /// since its neighbours shine through its edge.
    pub fn cell(self, number: u32) -> [f64; 4] {
        let [columns, rows] = match self {
            Self::Spines => print::SPINES,
            Self::Pictures => [paintings::PICTURES; 2],
            Self::Cardboard => [2, 2],
            _ => [1, 1],
        };
        let at = [number % columns, number / columns % rows];
        let [width, height] = self.size().map(f64::from);
        let (inset_u, inset_v) = (1.0 / width, 1.0 / height);
        let [left, right] = [at[0], at[0] + 1].map(|i| f64::from(i) / f64::from(columns));
        let [top, bottom] = [at[1], at[1] + 1].map(|i| f64::from(i) / f64::from(rows));
        [left + inset_u, top + inset_v, right - inset_u, bottom - inset_v]
    }

    /// Makes it.
    pub fn image(self) -> Image {
        match self {
            Self::Planks => self.painted(wood::planks()),
            Self::Wood => self.painted(wood::boards()),
            Self::Paint => self.painted(wood::paint()),
            Self::Plaster => self.painted(walls::plaster()),
            Self::Wallpaper => self.painted(walls::wallpaper()),
            Self::Stoneware => self.painted(walls::stoneware()),
            Self::Weave => self.painted(cloth::weave()),
            Self::Linen => self.painted(cloth::linen()),
            Self::Rug => self.painted(cloth::rug()),
            Self::Wool => self.painted(cloth::wool()),
            Self::Spines => self.painted(print::spines()),
            Self::Paper => self.painted(print::paper()),
            Self::Screen => self.painted(print::screen()),
            Self::Pictures => self.painted(paintings::pictures()),
            Self::Garden => self.painted(nature::garden()),
            Self::Leaf => self.painted(nature::leaf()),
            Self::Skin => self.painted(nature::skin()),
            Self::Cardboard => self.painted(walls::cardboard()),
        }
    }

    /// An image of sRGB colours by place, (0, 0) to (1, 1) from the top left.
    fn painted(self, colour: impl Fn(f32, f32) -> Vec3 + Sync) -> Image {
        let [width, height] = self.size();
        let mut pixels = vec![[0; 4]; (width * height) as usize];
        in_parallel(&mut pixels, width as usize, |row, pixels| {
            let y = (row as f32 + 0.5) / height as f32;
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let [r, g, b] = colour((column as f32 + 0.5) / width as f32, y)
                    .to_array()
                    .map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8);
                *pixel = [r, g, b, 255];
            }
        });
        Image { width, height, pixels }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean square of what one level of halving takes away, by level from the finest.
    fn energies(image: &Image) -> Vec<f32> {
        let (mut width, mut height) = (image.width as usize, image.height as usize);
        let mut values: Vec<f32> =
            image.pixels.iter().map(|[r, g, b, _]| (f32::from(*r) + f32::from(*g) + f32::from(*b)) / 3.0).collect();
        let mut found = Vec::new();
        while width.min(height) >= 8 {
            let (w, h) = (width / 2, height / 2);
            let at = |x: usize, y: usize| values[y * width + x];
            let halved: Vec<f32> = (0..w * h)
                .map(|i| (i % w * 2, i / w * 2))
                .map(|(x, y)| 0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)))
                .collect();
            let square =
                |i: usize| (at(i % (2 * w), i / (2 * w)) - halved[i / (2 * w) / 2 * w + i % (2 * w) / 2]).powi(2);
            found.push((0..4 * w * h).map(square).sum::<f32>() / (4 * w * h) as f32);
            (values, width, height) = (halved, w, h);
        }
        found
    }

    /// If this failed, a texture would be flat from near or from far, and more photographs of it would show nothing more.
    #[test]
    fn textures_have_detail_at_several_scales() {
        for texture in Texture::ALL {
            let image = texture.image();
            let [width, height] = texture.size();
            assert_eq!((image.width, image.height, image.pixels.len()), (width, height, (width * height) as usize));
            let energies = energies(&image);
            // Of 255 levels.
            let strong = energies.iter().filter(|energy| **energy > 0.5).count();
            assert!(strong >= 4 && energies[..3].iter().sum::<f32>() > 1.5, "{texture:?}: {energies:?}");
        }
    }

    /// If this failed, rooms would be darker or brighter than they should be, or more colourful than rooms are.
    #[test]
    fn textures_have_natural_colours() {
        for texture in Texture::ALL {
            let image = texture.image();
            let count = image.pixels.len() as f64;
            let sum = image.pixels.iter().fold([0.0; 3], |sum: [f64; 3], pixel| {
                std::array::from_fn(|c| sum[c] + crate::scene::colour::linear(pixel[c]))
            });
            let mean = sum.map(|v| v / count);
            let (low, high) = (mean.into_iter().fold(1.0, f64::min), mean.into_iter().fold(0.0, f64::max));
            assert!(low > 0.05 && high < 0.9 && high < 4.5 * low, "{texture:?}: {mean:?}");
        }
    }

    /// If this failed, the edge of a thing would show what is beside it on the texture.
    #[test]
    fn pieces_lie_within_their_texture() {
        for (texture, count) in [(Texture::Spines, 64), (Texture::Pictures, 9), (Texture::Cardboard, 4)] {
            let pieces: Vec<[f64; 4]> = (0..count).map(|number| texture.cell(number)).collect();
            for (i, a) in pieces.iter().enumerate() {
                assert!(a[0] > 0.0 && a[1] > 0.0 && a[2] < 1.0 && a[3] < 1.0 && a[0] < a[2] && a[1] < a[3]);
                let apart = |b: &[f64; 4]| a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1];
                assert!(pieces[..i].iter().all(apart));
            }
        }
    }
}
