//! Straightening pictures: from what a lens bends to its pinhole.

use glam::{DVec2, Vec2, Vec4};

use crate::engine::vulkan::shaders::glsl::splats::photo;
use crate::scene::camera::Intrinsics;
use crate::scene::lens::Lens;

/// The pixel of which a photo shows nothing, since straightening it reaches past its rim: transparent white. No other pixel
/// without alpha has a colour.
pub const UNKNOWN: u32 = photo::UNKNOWN;

/// Where the pixels of a lens's pinhole lie in the pictures that are taken through it.
pub struct Map {
    lens: Lens,
    /// By row: pixels, less half a pixel. Not finite where the lens shows nothing.
    places: Vec<Vec2>,
}

impl Map {
    /// The map of a lens.
    pub fn new(lens: Lens) -> Self {
        let Intrinsics { width, height, focal, principal } = lens.intrinsics;
        let place = |x: u32, y: u32| {
            let pixel = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
            let ray = ((pixel - DVec2::from(principal)) / DVec2::from(focal)).extend(1.0);
            lens.pixel(ray).map_or(Vec2::NAN, |at| (at - 0.5).as_vec2())
        };
        let mut places = Vec::with_capacity(width as usize * height as usize);
        for y in 0..height {
            places.extend((0..width).map(|x| place(x, y)));
        }
        Self { lens, places }
    }

    /// Whether it is that of a lens.
    pub fn is_of(&self, lens: &Lens) -> bool {
        self.lens == *lens
    }

    /// A picture that was taken through the lens, as its pinhole alone shows it: bilinear between the nearest pixels, colours
    /// weighted by alpha, [`UNKNOWN`] where the picture does not reach. Pixels are those of
    /// [`Picture`](super::pictures::Picture), as many as the lens has.
    pub fn straightened(&self, pixels: &[u32]) -> Vec<u32> {
        let Intrinsics { width, height, .. } = self.lens.intrinsics;
        let value = |at: &Vec2| if at.is_nan() { UNKNOWN } else { between(width, height, pixels, *at) };
        self.places.iter().map(value).collect()
    }
}

/// The value at a place in a picture, whose pixels' centres are at whole numbers; outside, the nearest border pixel counts.
fn between(width: u32, height: u32, pixels: &[u32], at: Vec2) -> u32 {
    let at = at.clamp(Vec2::ZERO, Vec2::new((width - 1) as f32, (height - 1) as f32));
    let (x, y) = (at.x as u32, at.y as u32);
    let (u, v) = (at.x - x as f32, at.y - y as f32);
    let (right, below) = ((x + 1).min(width - 1), (y + 1).min(height - 1));
    let pixel = |x: u32, y: u32| premultiplied(pixels[y as usize * width as usize + x as usize]);
    straight(pixel(x, y).lerp(pixel(right, y), u).lerp(pixel(x, below).lerp(pixel(right, below), u), v))
}

/// Red, green and blue times alpha, and alpha, each of 255.
fn premultiplied(pixel: u32) -> Vec4 {
    let [r, g, b, a] = pixel.to_le_bytes().map(f32::from);
    Vec4::new(r * a, g * a, b * a, 255.0 * a) / 255.0
}

/// The pixel of a colour times alpha.
fn straight(colour: Vec4) -> u32 {
    let byte = |value: f32| (value + 0.5) as u8;
    let alpha = byte(colour.w);
    if alpha == 0 {
        return 0;
    }
    let [r, g, b, _] = (colour * (255.0 / colour.w)).to_array().map(byte);
    u32::from_le_bytes([r, g, b, alpha])
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::lens::Distortion;

    const INTRINSICS: Intrinsics =
        Intrinsics { width: 200, height: 140, focal: [150.0, 155.0], principal: [104.0, 66.0] };

    /// What is seen in a direction, of which x/z and y/z are given: smooth, and different in each channel.
    fn scene(p: DVec2) -> [f64; 3] {
        [(3.0 * p.x + 1.0 * p.y).sin(), (2.0 * p.y - p.x).cos(), (2.5 * p.x * p.y + p.x).sin()]
            .map(|v| 127.5 + 120.0 * v)
    }

    /// The scene through a lens, and how much of each pixel is opaque.
    fn taken(lens: &Lens, alpha: impl Fn(DVec2) -> f64) -> Vec<u32> {
        let Intrinsics { width, height, .. } = lens.intrinsics;
        let pixel = |x: u32, y: u32| {
            // The corners of a barrel may show nothing.
            let ray = lens.unproject(DVec2::new(f64::from(x), f64::from(y)) + 0.5).unwrap_or(DVec3::Z);
            let p = ray.truncate() / ray.z;
            let [r, g, b] = scene(p).map(|v| v.round() as u8);
            u32::from_le_bytes([r, g, b, alpha(p).round() as u8])
        };
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| pixel(x, y)).collect()
    }

    /// x/z and y/z of what a pixel of the pinhole shows.
    fn shown(i: usize) -> DVec2 {
        let Intrinsics { width, focal, principal, .. } = INTRINSICS;
        let pixel = DVec2::new((i % width as usize) as f64, (i / width as usize) as f64) + 0.5;
        (pixel - DVec2::from(principal)) / DVec2::from(focal)
    }

    /// The scene is known in closed form. If this failed, photos would be trained on that their cameras do not explain.
    #[test]
    fn a_straightened_picture_is_the_pinholes() {
        let none = Distortion::default();
        for distortion in [
            Distortion { radial: [0.2, -0.05, 0.0, 0.0, 0.0, 0.0], tangential: [2e-3, -3e-3], ..none },
            Distortion { radial: [-0.15, 0.02, 0.0, 0.0, 0.0, 0.0], ..none },
            Distortion { fisheye: true, radial: [0.01, 0.0, 0.0, 0.0, 0.0, 0.0], ..none },
            none,
        ] {
            let lens = Lens::new(INTRINSICS, distortion);
            let pixels = Map::new(lens).straightened(&taken(&lens, |_| 255.0));
            assert_eq!(pixels.len(), 200 * 140);
            let mut worst = 0f64;
            for (i, pixel) in pixels.iter().enumerate().filter(|(_, pixel)| **pixel != UNKNOWN) {
                let [r, g, b, a] = pixel.to_le_bytes();
                assert_eq!(a, 255);
                let difference = |(value, wanted): (u8, f64)| (f64::from(value) - wanted).abs();
                worst = [r, g, b].into_iter().zip(scene(shown(i))).map(difference).fold(worst, f64::max);
            }
            // Half a level of each rounding, what bends between two pixels, and half a pixel of slope at the rim.
            assert!(worst < 2.5, "off by {worst} with {distortion:?}");
        }
    }

    /// Computed directly: the pinhole's direction u is at `u (1 + k u^2)` in the photo. If this failed, black rims would be learnt, or
    /// much of the photos thrown away.
    #[test]
    fn pixels_past_the_photos_rim_are_unknown() {
        let k = 0.3;
        let lens = Lens::new(INTRINSICS, Distortion { radial: [k, 0.0, 0.0, 0.0, 0.0, 0.0], ..Distortion::default() });
        let pixels = Map::new(lens).straightened(&taken(&lens, |_| 255.0));
        let mut unknown = 0;
        for (i, pixel) in pixels.iter().enumerate() {
            let p = shown(i);
            let at =
                p * (1.0 + k * p.length_squared()) * DVec2::from(INTRINSICS.focal) + DVec2::from(INTRINSICS.principal);
            let inside = at.x >= 0.0 && at.x < 200.0 && at.y >= 0.0 && at.y < 140.0;
            assert_eq!(*pixel != UNKNOWN, inside, "pixel {i} at {at}");
            unknown += usize::from(!inside);
        }
        assert!(unknown > 1000 && unknown < 14_000, "{unknown}");
        let barrel =
            Lens::new(INTRINSICS, Distortion { radial: [-k, 0.0, 0.0, 0.0, 0.0, 0.0], ..Distortion::default() });
        assert!(!Map::new(barrel).straightened(&taken(&barrel, |_| 255.0)).contains(&UNKNOWN));
    }

    /// If this failed, the colour behind cut-out objects would bleed into their border.
    #[test]
    fn colours_are_weighted_by_alpha() {
        let opaque = u32::from_le_bytes([200, 100, 50, 255]);
        let half = u32::from_le_bytes([100, 100, 150, 51]);
        // A quarter of the way from the first pixel to the second.
        let mix = |a, b| between(2, 1, &[a, b], Vec2::new(0.25, 0.0)).to_le_bytes();
        assert_eq!(mix(opaque, 0), [200, 100, 50, 191]);
        // 0.75 of the first, and 0.25 * 0.2 of the second: shares 15/16 and 1/16.
        assert_eq!(mix(opaque, half), [194, 100, 56, 204]);
        assert_eq!(mix(0, 0), [0; 4]);
        assert_eq!(mix(u32::from_le_bytes([9, 9, 9, 1]), u32::from_le_bytes([9, 9, 9, 0])), [9, 9, 9, 1]);
        assert_eq!(mix(u32::from_le_bytes([9, 9, 9, 0]), u32::from_le_bytes([9, 9, 9, 1])), [0; 4]);
        let lens =
            Lens::new(INTRINSICS, Distortion { radial: [-0.15, 0.02, 0.0, 0.0, 0.0, 0.0], ..Distortion::default() });
        let cover = |p: DVec2| (300.0 - 600.0 * p.length()).clamp(0.0, 255.0);
        for (i, pixel) in Map::new(lens).straightened(&taken(&lens, cover)).iter().enumerate() {
            let [r, _, _, a] = pixel.to_le_bytes();
            assert!((f64::from(a) - cover(shown(i))).abs() < 6.0, "pixel {i}: alpha {a}");
            assert!(a < 8 || (f64::from(r) - scene(shown(i))[0]).abs() < 2.5, "pixel {i}: red {r}");
            assert!(a > 0 || *pixel == 0);
        }
    }
}
