//! Exposure: metered as a camera does it, and how much of a picture is brighter than white.

use std::ops::ControlFlow;

use super::tracer::{Exposure, Photograph, Tracer};
use crate::Result;
use crate::scene::camera::Camera;

/// Cameras that are metered at most, evenly chosen; longer side of their pictures, and samples of a pixel.
const CAMERAS: usize = 16;
const SIDE: u32 = 64;
const SAMPLES: u32 = 32;
/// Share of the pixels that may be brighter than white: lamps and glints.
const BRIGHTER: f64 = 0.01;
/// Stops are whole multiples of this, as on cameras, so that noise gives no other exposure.
const STEPS_PER_STOP: f32 = 3.0;

/// The largest exposure in stops at which one pixel in a hundred is brighter than white, over small pictures of some of the cameras; 0
/// where nothing is lit.
///
/// # Errors
/// Where the device fails, or `go_on` requests a stop.
pub fn metered(
    tracer: &Tracer,
    cameras: &[Camera],
    show_sky: bool,
    seed: u64,
    mut go_on: impl FnMut() -> ControlFlow<()>,
) -> Result<f32> {
    let mut levels = Vec::new();
    let count = cameras.len().min(CAMERAS);
    for i in 0..count {
        let camera = &cameras[i * cameras.len() / count];
        let side = camera.intrinsics.width.max(camera.intrinsics.height);
        let intrinsics = camera.intrinsics.shrunk(side.div_ceil(SIDE));
        let exposure = Exposure { samples: SAMPLES, seed, show_sky };
        let taken = tracer.photograph(&Camera { intrinsics, ..camera.clone() }, i as u32, exposure, &mut go_on)?;
        levels.extend(taken.pixels.iter().filter_map(|pixel| level(pixel, !show_sky)));
    }
    levels.retain(|level| *level > 0.0);
    if levels.is_empty() {
        return Ok(0.0);
    }
    levels.sort_unstable_by(f32::total_cmp);
    let rank = ((1.0 - BRIGHTER) * (levels.len() - 1) as f64).round() as usize;
    Ok((-levels[rank].log2() * STEPS_PER_STOP).floor() / STEPS_PER_STOP)
}

/// How many pixels of a photograph that show something are brighter than white at an exposure in stops, and how many show something.
pub fn brighter(taken: &Photograph, stops: f32, with_alpha: bool) -> [u64; 2] {
    let gain = stops.exp2();
    let levels = || taken.pixels.iter().filter_map(|pixel| level(pixel, with_alpha));
    // A little over one is white after rounding too.
    [levels().filter(|level| gain * level > 1.002).count() as u64, levels().count() as u64]
}

/// The largest channel of a pixel's radiance, as a picture shows it; none where it shows nothing.
fn level([r, g, b, alpha]: &[f32; 4], with_alpha: bool) -> Option<f32> {
    let largest = r.max(*g).max(*b);
    match (with_alpha, *alpha > 0.0) {
        (false, _) => Some(largest),
        (true, true) => Some(largest / alpha),
        (true, false) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a burnt-out picture would be written without a warning, or a warning be given for what nobody sees.
    #[test]
    fn pixels_brighter_than_white_are_counted_where_something_is() {
        let pixels = vec![[0.5, 0.2, 0.1, 1.0], [0.3, 0.6, 0.1, 0.5], [9.0, 0.0, 0.0, 0.0], [1.0; 4]];
        let taken = Photograph { width: 2, pixels };
        assert_eq!(brighter(&taken, 0.0, true), [1, 3]);
        assert_eq!(brighter(&taken, 0.0, false), [1, 4]);
        assert_eq!(brighter(&taken, 1.1, true), [3, 3]);
        assert_eq!(brighter(&taken, -0.5, true), [0, 3]);
    }
}
