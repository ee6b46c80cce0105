//! Surfaces as arrays.

use std::path::PathBuf;

use camsplat::files::io;
use camsplat::scene::surface::Surface;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray as _, PyArray2};
use pyo3::prelude::*;

use super::failed;

/// Vertices, V x 3; of a mesh faces, F x 3, vertex indices; notes.
type Arrays<'py> = (Bound<'py, PyArray2<f64>>, Option<Bound<'py, PyArray2<u32>>>, Vec<String>);

/// Reads a surface of any format that the command reads.
#[pyfunction]
pub fn read_surface(py: Python<'_>, path: PathBuf) -> PyResult<Arrays<'_>> {
    let (surface, notes) = py.detach(|| io::read_surface_with_notes(&path)).map_err(failed)?;
    let positions = surface.positions();
    let vertices = Array2::from_shape_fn((positions.len(), 3), |(i, axis)| positions[i][axis]);
    let faces = match &surface {
        Surface::Mesh(mesh) => {
            let triangles = &mesh.triangles;
            Some(Array2::from_shape_fn((triangles.len(), 3), |(i, corner)| triangles[i][corner]).into_pyarray(py))
        }
        Surface::Points(_) => None,
    };
    Ok((vertices.into_pyarray(py), faces, notes))
}
