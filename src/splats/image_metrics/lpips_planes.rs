//! What networks make of a picture's bytes (`lpips_planes.comp`).

use super::Rgb8;

crate::gpu_struct! {
    /// Push constants of [`LpipsPlanesStage`].
    pub struct PlanesPush {
        /// Pixels of the picture.
        pub pixels: u32,
    }
}

crate::stage!(
    /// A thread per pixel.
    pub LpipsPlanesStage = lpips_planes(PlanesPush) { read picture, read values, write planes }
);

/// What each byte of each channel means, with the mean and deviation that networks were trained with taken out: ImageNet's, of values
/// in [0, 1]; LPIPS has them for values in [-1, 1] (`ScalingLayer` of its code).
pub fn values() -> [[f32; 256]; 3] {
    const SHIFT: [f64; 3] = [-0.030, -0.088, -0.188];
    const SCALE: [f64; 3] = [0.458, 0.448, 0.450];
    std::array::from_fn(|c| {
        std::array::from_fn(|byte| ((2.0 * byte as f64 / 255.0 - 1.0 - SHIFT[c]) / SCALE[c]) as f32)
    })
}

/// The twin of `lpips_planes`: the planes of red, green and blue, one after another, each row by row.
pub fn lpips_planes(picture: &Rgb8) -> Vec<f32> {
    let of = |(c, values): (usize, [f32; 256])| {
        let pixels = picture.pixels().as_chunks::<3>().0.iter();
        pixels.map(move |pixel| values[usize::from(pixel[c])]).collect::<Vec<f32>>()
    };
    values().into_iter().enumerate().flat_map(of).collect()
}
