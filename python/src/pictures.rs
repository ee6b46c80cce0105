//! Pictures of trained splats as arrays.

use std::ops::ControlFlow;
use std::path::PathBuf;

use camsplat::engine::vulkan::{Context, ContextOptions};
use camsplat::files::io;
use camsplat::splats::render::pictures::{Format, Job, RenderSettings};
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray as _, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use super::cameras::cameras;
use super::{failed, unless_forked};

/// A picture and its depths, where they are wanted.
type Picture<'py> = (Bound<'py, PyArray3<f32>>, Option<Bound<'py, PyArray2<f32>>>);

/// Renders trained splats of a file from cameras as [`cameras`] takes them. Every picture is height x width x 3 sRGB values from 0 to 1 over
/// the background, or x 4 with alpha, colours not multiplied by it; depths are height x width, in the model's units, 0 where nothing is
/// seen.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "a boundary between languages: the package names them")]
pub fn render<'py>(
    py: Python<'py>,
    model: PathBuf,
    names: Vec<String>,
    poses: PyReadonlyArray3<'py, f64>,
    lenses: PyReadonlyArray2<'py, f64>,
    sizes: PyReadonlyArray2<'py, u32>,
    background: [f32; 3],
    alpha: bool,
    depth: bool,
    antialiased: bool,
    near: Option<f64>,
    device: Option<String>,
) -> PyResult<Vec<Picture<'py>>> {
    unless_forked()?;
    let cameras = cameras(names, &poses, &lenses, &sizes);
    // Checked again after every picture, so that Ctrl-C is heard.
    let mut raised = None;
    let pictures = py.detach(|| -> camsplat::Result<_> {
        let (gaussians, _) = io::read_gaussians_with_notes(&model)?;
        let antialiased = antialiased || gaussians.antialiased;
        let job =
            Job::new(&cameras, RenderSettings { format: Format::Exr, alpha, depth, background, antialiased, near })?;
        let context = Context::new(&ContextOptions { device, ..ContextOptions::default() })?;
        let mut pictures = Vec::new();
        job.pictures(&context, gaussians, |rendering, unit| {
            let shape = (rendering.height as usize, rendering.width as usize);
            let channels = if alpha { 4 } else { 3 };
            let straight = if alpha { rendering.straight() } else { Vec::new() };
            let pixels = if alpha { &straight } else { &rendering.pixels };
            let colours = Array3::from_shape_fn((shape.0, shape.1, channels), |(row, column, channel)| {
                pixels[row * shape.1 + column][channel]
            });
            let depths = depth.then(|| {
                let depths = rendering.expected_depths(unit);
                Array2::from_shape_fn(shape, |(row, column)| depths[row * shape.1 + column])
            });
            pictures.push((colours, depths));
            match Python::attach(|py| py.check_signals()) {
                Ok(()) => ControlFlow::Continue(()),
                Err(error) => {
                    raised = Some(error);
                    ControlFlow::Break(())
                }
            }
        })?;
        Ok(pictures)
    });
    let pictures = pictures.map_err(failed)?;
    match raised {
        Some(error) => Err(error),
        None => Ok(pictures
            .into_iter()
            .map(|(colours, depths)| (colours.into_pyarray(py), depths.map(|depths| depths.into_pyarray(py))))
            .collect()),
    }
}
