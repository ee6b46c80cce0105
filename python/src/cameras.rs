//! Cameras as arrays, and back.

use std::collections::HashSet;
use std::path::PathBuf;

use camsplat::files::io;
use camsplat::files::io::folder::OutputFolder;
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::surface::Points;
use glam::{DMat3, DMat4, DQuat, DVec3};
use numpy::ndarray::{Array2, Array3};
use numpy::{IntoPyArray as _, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;

use super::{Error, failed};

/// Names; poses, N x 4 x 4, world-from-camera in OpenCV axes; lenses, N x 4, focal lengths and principal point in pixels (fx, fy, cx, cy);
/// sizes, N x 2, width and height in pixels.
type Arrays<'py> =
    (Vec<String>, Bound<'py, PyArray3<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<u32>>, Vec<String>);

/// Reads the cameras of a file or folder, of any format that the command reads; the last of what is returned are notes.
#[pyfunction]
pub fn read_cameras(py: Python<'_>, path: PathBuf) -> PyResult<Arrays<'_>> {
    let (cameras, notes) = py.detach(|| io::read_cameras_with_notes(&io::plan_file(&path))).map_err(failed)?;
    let count = cameras.len();
    let mut poses = Array3::zeros((count, 4, 4));
    let mut lenses = Array2::zeros((count, 4));
    let mut sizes = Array2::zeros((count, 2));
    for (i, Camera { pose, intrinsics, .. }) in cameras.iter().enumerate() {
        let matrix = DMat4::from_rotation_translation(pose.rotation, pose.position);
        for row in 0..4 {
            for column in 0..4 {
                poses[[i, row, column]] = matrix.col(column)[row];
            }
        }
        let Intrinsics { width, height, focal: [fx, fy], principal: [cx, cy] } = *intrinsics;
        for (at, value) in [fx, fy, cx, cy].into_iter().enumerate() {
            lenses[[i, at]] = value;
        }
        (sizes[[i, 0]], sizes[[i, 1]]) = (width, height);
    }
    let names = cameras.into_iter().map(|camera| camera.name).collect();
    Ok((names, poses.into_pyarray(py), lenses.into_pyarray(py), sizes.into_pyarray(py), notes))
}

/// Cameras of arrays whose shapes and values the package has checked.
pub fn cameras(
    names: Vec<String>,
    poses: &PyReadonlyArray3<'_, f64>,
    lenses: &PyReadonlyArray2<'_, f64>,
    sizes: &PyReadonlyArray2<'_, u32>,
) -> Vec<Camera> {
    let (poses, lenses, sizes) = (poses.as_array(), lenses.as_array(), sizes.as_array());
    let camera = |(i, name)| {
        let column = |column: usize| DVec3::from_array([0, 1, 2].map(|row| poses[[i, row, column]]));
        let rotation = DQuat::from_mat3(&DMat3::from_cols(column(0), column(1), column(2))).normalize();
        let [fx, fy, cx, cy] = [0, 1, 2, 3].map(|at| lenses[[i, at]]);
        Camera {
            name,
            pose: Pose { position: column(3), rotation },
            intrinsics: Intrinsics {
                width: sizes[[i, 0]],
                height: sizes[[i, 1]],
                focal: [fx, fy],
                principal: [cx, cy],
            },
        }
    };
    names.into_iter().enumerate().map(camera).collect()
}

/// Writes cameras for a command to read, as a plan.json without a plan.
#[pyfunction]
pub fn write_cameras(
    path: PathBuf,
    names: Vec<String>,
    poses: PyReadonlyArray3<'_, f64>,
    lenses: PyReadonlyArray2<'_, f64>,
    sizes: PyReadonlyArray2<'_, u32>,
) -> PyResult<()> {
    let cameras = cameras(names, &poses, &lenses, &sizes);
    let text = serde_json::json!({ "cameras": cameras }).to_string();
    std::fs::write(&path, text).map_err(|error| Error::new_err(format!("{}: {error}", path.display())))
}

/// Writes cameras and points, P x 3, with their colours, P x 3 or none, into a folder that is new or empty: all files of a capture but its
/// images, which are `images/` and the cameras' names.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "a boundary between languages: the package names them")]
pub fn write_capture(
    py: Python<'_>,
    path: PathBuf,
    names: Vec<String>,
    poses: PyReadonlyArray3<'_, f64>,
    lenses: PyReadonlyArray2<'_, f64>,
    sizes: PyReadonlyArray2<'_, u32>,
    points: PyReadonlyArray2<'_, f64>,
    colours: PyReadonlyArray2<'_, u8>,
) -> PyResult<()> {
    let cameras = cameras(names, &poses, &lenses, &sizes);
    let mut images = HashSet::new();
    if let Some(twice) = cameras.iter().map(Camera::image_name).find(|name| !images.insert(name.clone())) {
        return Err(Error::new_err(format!("names: two cameras have the image {twice}; rename one")));
    }
    let rows = points.as_array();
    let positions = rows.rows().into_iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect();
    let rows = colours.as_array();
    let colours = rows.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect();
    py.detach(|| {
        let folder = OutputFolder::create(&path, false)?;
        io::camera_files::capture(&folder, &cameras, &Points { positions, colours, ..Points::default() }, &[])?;
        folder.commit()
    })
    .map_err(failed)
}
