//! A capture to plan further photos for: the photos that there are, and the surface that they show.

use std::path::Path;

use super::options::read_surface;
use super::place;
use crate::files::io;
use crate::files::photos::PhotoSet;
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Reads a capture and its surface, its own points where no other is given; prints what was understood. Where its lengths are to be said
/// in metres (`metric`), GPS of its photos is looked for.
///
/// # Errors
/// Where it cannot be read, or no points and no surface are there.
pub fn read(path: &Path, surface: Option<&Path>, metric: bool) -> Result<(Surface, PhotoSet)> {
    let mut capture = io::photos::read(path, &io::photos::ReadOptions::default())?;
    if metric && capture.metre.is_none() {
        capture.metre = place::metre(&capture)?;
    }
    for note in &capture.notes {
        say!("{note}");
    }
    if let Some(file) = surface {
        return Ok((read_surface(file)?, capture));
    }
    if capture.points.positions.is_empty() {
        let what = "the capture holds no points; make a surface from its photos with `camsplat proxy` and give it with --surface";
        return Err(Error::input(path, what));
    }
    Ok((Surface::Points(capture.points.clone()), capture))
}
