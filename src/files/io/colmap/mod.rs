//! COLMAP sparse models: cameras, images and points3D, as text or little-endian binary.
//!
//! COLMAP stores camera-from-world rotations and translations in OpenCV axes; here poses are world-from-camera. The
//! world frame and its arbitrary scale are left as they are. Files of rigs and frames, which newer versions add, are
//! not needed: images.txt and images.bin hold every pose as well.

pub mod binary;
mod subset;
pub mod text;
pub(crate) mod write;

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

pub use self::subset::{Subset, subset};
use super::checks;
use crate::error::{Error, Result};
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::lens::Distortion;
use crate::scene::surface::{Points, Surface};

/// A camera model: what the parameters mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Projection {
    /// Number in binary files.
    pub id: u32,
    /// Name in text files.
    pub name: &'static str,
    /// Number of parameters.
    pub parameters: usize,
    /// Whether one focal length serves both axes: f cx cy ... instead of fx fy cx cy ...
    pub one_focal: bool,
}

/// The models that COLMAP numbers 0 to 11; later ones are refused by their number.
pub(crate) const PROJECTIONS: [Projection; 12] = [
    projection(0, "SIMPLE_PINHOLE", 3, true),
    projection(1, "PINHOLE", 4, false),
    projection(2, "SIMPLE_RADIAL", 4, true),
    projection(3, "RADIAL", 5, true),
    projection(4, "OPENCV", 8, false),
    projection(5, "OPENCV_FISHEYE", 8, false),
    projection(6, "FULL_OPENCV", 12, false),
    projection(7, "FOV", 5, false),
    projection(8, "SIMPLE_RADIAL_FISHEYE", 4, true),
    projection(9, "RADIAL_FISHEYE", 5, true),
    projection(10, "THIN_PRISM_FISHEYE", 12, false),
    projection(11, "RAD_TAN_THIN_PRISM_FISHEYE", 16, false),
];

const fn projection(id: u32, name: &'static str, parameters: usize, one_focal: bool) -> Projection {
    Projection { id, name, parameters, one_focal }
}

/// Intrinsics that images share.
#[derive(Clone, Debug, PartialEq)]
pub struct Lens {
    /// How the parameters were read.
    pub projection: Projection,
    /// The pinhole part.
    pub intrinsics: Intrinsics,
    /// The parameters after the pinhole part, in COLMAP's order.
    pub distortion: Vec<f64>,
}

impl Lens {
    /// Splits COLMAP's parameters into the pinhole part and the distortion; none where their number is wrong.
    fn new(projection: Projection, [width, height]: [u32; 2], parameters: &[f64]) -> Option<Self> {
        if parameters.len() != projection.parameters {
            return None;
        }
        let (focal, rest) = match *parameters {
            [f, ref rest @ ..] if projection.one_focal => ([f, f], rest),
            [fx, fy, ref rest @ ..] => ([fx, fy], rest),
            _ => return None,
        };
        let (&principal, distortion) = rest.split_first_chunk::<2>()?;
        Some(Self {
            projection,
            intrinsics: Intrinsics { width, height, focal, principal },
            distortion: distortion.to_vec(),
        })
    }
}

impl Lens {
    /// A lens with a distortion in the form that holds every model, the inverse of [`Lens::unified`]; none where no model of COLMAP's
    /// has such a distortion.
    pub fn of(intrinsics: Intrinsics, distortion: Distortion) -> Option<Self> {
        let Distortion { fisheye, fov, radial, rational, tangential: [p1, p2], prism, after_radial } = distortion;
        let [k1, k2, k3, k4, ..] = radial;
        let (name, parameters) = if distortion.is_none() {
            ("PINHOLE", Vec::new())
        } else if after_radial {
            ("RAD_TAN_THIN_PRISM_FISHEYE", [&radial[..], &[p1, p2], &prism].concat())
        } else if fisheye && ([p1, p2] != [0.0; 2] || prism != [0.0; 4]) {
            ("THIN_PRISM_FISHEYE", vec![k1, k2, p1, p2, k3, k4, prism[0], prism[2]])
        } else if fisheye {
            ("OPENCV_FISHEYE", vec![k1, k2, k3, k4])
        } else if fov != 0.0 {
            ("FOV", vec![fov])
        } else if rational != [0.0; 3] || k3 != 0.0 {
            ("FULL_OPENCV", vec![k1, k2, p1, p2, k3, rational[0], rational[1], rational[2]])
        } else {
            ("OPENCV", vec![k1, k2, p1, p2])
        };
        let projection = *PROJECTIONS.iter().find(|projection| projection.name == name)?;
        let lens = Self { projection, intrinsics, distortion: parameters };
        (lens.unified() == distortion).then_some(lens)
    }

    /// COLMAP's parameters, in its order.
    pub fn parameters(&self) -> Vec<f64> {
        let focal = if self.projection.one_focal { &self.intrinsics.focal[..1] } else { &self.intrinsics.focal };
        [focal, &self.intrinsics.principal, &self.distortion].concat()
    }

    /// The distortion in the form that holds every model (formulae: COLMAP's `models.h`).
    pub fn unified(&self) -> Distortion {
        let none = Distortion::default();
        let k = |i: usize| self.distortion.get(i).copied().unwrap_or(0.0);
        let radial = |indices: &[usize]| {
            let mut factors = [0.0; 6];
            factors.iter_mut().zip(indices).for_each(|(factor, i)| *factor = k(*i));
            factors
        };
        match self.projection.name {
            "SIMPLE_RADIAL" => Distortion { radial: radial(&[0]), ..none },
            "RADIAL" => Distortion { radial: radial(&[0, 1]), ..none },
            "OPENCV" => Distortion { radial: radial(&[0, 1]), tangential: [k(2), k(3)], ..none },
            "FULL_OPENCV" => Distortion {
                radial: radial(&[0, 1, 4]),
                rational: [k(5), k(6), k(7)],
                tangential: [k(2), k(3)],
                ..none
            },
            "FOV" => Distortion { fov: k(0), ..none },
            "OPENCV_FISHEYE" => Distortion { fisheye: true, radial: radial(&[0, 1, 2, 3]), ..none },
            "SIMPLE_RADIAL_FISHEYE" => Distortion { fisheye: true, radial: radial(&[0]), ..none },
            "RADIAL_FISHEYE" => Distortion { fisheye: true, radial: radial(&[0, 1]), ..none },
            "THIN_PRISM_FISHEYE" => Distortion {
                fisheye: true,
                radial: radial(&[0, 1, 4, 5]),
                tangential: [k(2), k(3)],
                prism: [k(6), 0.0, k(7), 0.0],
                ..none
            },
            "RAD_TAN_THIN_PRISM_FISHEYE" => Distortion {
                fisheye: true,
                radial: radial(&[0, 1, 2, 3, 4, 5]),
                tangential: [k(6), k(7)],
                prism: [k(8), k(9), k(10), k(11)],
                after_radial: true,
                ..none
            },
            // The two pinholes.
            _ => none,
        }
    }
}

/// A posed image.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Number that tracks refer to.
    pub id: u32,
    /// Number of its lens.
    pub lens: u32,
    /// World-from-camera pose.
    pub pose: Pose,
    /// File name, relative to the image folder.
    pub name: String,
    /// Camera-from-world quaternion (w, x, y, z) and translation, as they are in the file.
    pub stored: ([f64; 4], [f64; 3]),
    /// What was observed in it, in the order of the file; empty where it was not requested.
    pub observations: Vec<Observation>,
}

/// A feature in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// Where, in pixels.
    pub pixel: [f64; 2],
    /// Number of the point that it shows, or [`NO_POINT`].
    pub point: u64,
}

/// The number that means no point.
pub const NO_POINT: u64 = u64::MAX;

/// A reconstructed point.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Number that observations refer to.
    pub id: u64,
    /// Position in the world.
    pub position: DVec3,
    /// 8-bit sRGB.
    pub colour: [u8; 3],
    /// Mean reprojection error in pixels.
    pub error: f64,
    /// Where it was seen: number of the image, and which of its observations.
    pub track: Vec<[u32; 2]>,
}

/// World-from-camera pose of a camera-from-world quaternion (w, x, y, z) and translation; none where the quaternion has
/// no length or a number is not finite.
fn pose([w, x, y, z]: [f64; 4], translation: [f64; 3]) -> Option<Pose> {
    let rotation = DQuat::from_xyzw(x, y, z, w);
    let length = rotation.length();
    if !(length.is_finite() && length > 1e-9) {
        return None;
    }
    let rotation = rotation.normalize().conjugate();
    let position = -(rotation * DVec3::from_array(translation));
    position.is_finite().then_some(Pose { position, rotation })
}

/// Where a model lies in a capture.
const MODEL_FOLDERS: [&str; 4] = ["", "sparse/0", "sparse", "colmap/sparse/0"];

/// The folder in or under `path` that holds a model: itself, `sparse/0`, `sparse` or `colmap/sparse/0`.
pub(crate) fn model_folder(path: &Path) -> Option<PathBuf> {
    MODEL_FOLDERS
        .iter()
        .map(|below| path.join(below))
        .find(|folder| file(folder, "cameras").is_some() && file(folder, "images").is_some())
}

/// What a folder in or under `path` that holds only one half of a model has, and what it lacks.
pub(crate) fn half_model(path: &Path) -> Option<(&'static str, &'static str)> {
    let has = |name: &str| MODEL_FOLDERS.iter().any(|below| file(&path.join(below), name).is_some());
    match (has("cameras"), has("images")) {
        (true, false) => Some(("cameras.bin or cameras.txt", "images.bin or images.txt")),
        (false, true) => Some(("images.bin or images.txt", "cameras.bin or cameras.txt")),
        _ => None,
    }
}

/// The binary or text file of that name in a model folder; the binary one where there are both, as COLMAP does.
fn file(folder: &Path, name: &str) -> Option<PathBuf> {
    ["bin", "txt"].iter().map(|extension| folder.join(name).with_extension(extension)).find(|path| path.is_file())
}

/// Reads one of the model's files with the parser of its encoding.
fn read<T>(
    folder: &Path,
    name: &str,
    binary: impl Fn(&Path, &[u8]) -> Result<T>,
    text: impl Fn(&Path, &[u8]) -> Result<T>,
) -> Result<(PathBuf, T)> {
    let path = file(folder, name).ok_or_else(|| {
        Error::input(folder, format!("it holds no {name}.bin and no {name}.txt; export the model again"))
    })?;
    let bytes = super::read_file(&path)?;
    let is_binary = path.extension().is_some_and(|e| e == "bin");
    let value = if is_binary { binary(&path, &bytes)? } else { text(&path, &bytes)? };
    Ok((path, value))
}

/// Reads the cameras of a model folder, ordered by name, since COLMAP's own order changes from run to run.
pub fn cameras(folder: &Path, notes: &mut Vec<String>) -> Result<Vec<Camera>> {
    let (_, lenses) = read(folder, "cameras", binary::cameras, text::cameras)?;
    let (path, images) = read(folder, "images", binary::images, text::images)?;
    join(&path, &lenses, images, notes)
}

/// All parts of a model, images and cameras in the order of names.
pub struct Model {
    /// Lenses by their number.
    pub lenses: BTreeMap<u32, Lens>,
    /// Images, ordered by name.
    pub images: Vec<Image>,
    /// Their cameras, in the same order.
    pub cameras: Vec<Camera>,
    /// The points as a surface and as they are in the file; none where there is no file of points or it is empty.
    pub points: Option<(Surface, Vec<Point>)>,
}

/// Reads a whole model folder.
pub fn model(folder: &Path) -> Result<Model> {
    let (_, lenses) = read(folder, "cameras", binary::cameras, text::cameras)?;
    let (path, mut images) = read(folder, "images", binary::images, text::images)?;
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let cameras = join(&path, &lenses, images.clone(), &mut Vec::new())?;
    let mut points = None;
    if file(folder, "points3D").is_some() {
        let (path, sparse) = read(folder, "points3D", binary::points, text::points)?;
        if !sparse.is_empty() {
            let centres = images.iter().map(|image| (image.id, image.pose.position)).collect();
            points = Some((points_surface(&path, &sparse, &centres)?, sparse));
        }
    }
    Ok(Model { lenses, images, cameras, points })
}

/// Gives every image its lens; `path` is for messages only.
pub fn join(
    path: &Path,
    lenses: &BTreeMap<u32, Lens>,
    mut images: Vec<Image>,
    notes: &mut Vec<String>,
) -> Result<Vec<Camera>> {
    images.sort_by(|a, b| a.name.cmp(&b.name));
    let mut distorted = 0;
    let mut cameras = Vec::with_capacity(images.len());
    for image in images {
        let Some(lens) = lenses.get(&image.lens) else {
            return Err(Error::input(
                path,
                format!(
                    "image {} ({:?}) was taken with camera {}, which is not among the {} cameras of the model; export \
                     the model again",
                    image.id,
                    image.name,
                    image.lens,
                    lenses.len()
                ),
            ));
        };
        distorted += usize::from(lens.distortion.iter().any(|&k| k != 0.0));
        cameras.push(Camera { name: image.name, pose: image.pose, intrinsics: lens.intrinsics });
    }
    if distorted > 0 {
        notes.push(checks::taken_as_pinholes(distorted, cameras.len()));
    }
    checks::cameras(path, cameras.iter())?;
    Ok(cameras)
}

/// Reads the points of a model folder.
pub fn surface(folder: &Path, notes: &mut Vec<String>) -> Result<Surface> {
    let (path, points) = read(folder, "points3D", binary::points, text::points)?;
    let (_, images) = read(folder, "images", binary::images, text::images)?;
    let centres = images.iter().map(|image| (image.id, image.pose.position)).collect();
    let surface = points_surface(&path, &points, &centres)?;
    let error = points.iter().map(|p| p.error).sum::<f64>() / points.len() as f64;
    notes.push(format!(
        "COLMAP model of {} images and {} points, mean reprojection error {error:.2} pixels",
        images.len(),
        points.len()
    ));
    Ok(surface)
}

/// The points as a surface, with the mean direction to the cameras of each point's track; `centres` are the camera
/// centres by image number.
pub fn points_surface(path: &Path, points: &[Point], centres: &HashMap<u32, DVec3>) -> Result<Surface> {
    let mut surface = Points::default();
    for (i, point) in points.iter().enumerate() {
        let mut toward = DVec3::ZERO;
        for [image, _] in &point.track {
            let Some(centre) = centres.get(image) else {
                let what = format!("point {i} was seen in image {image}, which the model lacks; export it again");
                return Err(Error::input(path, what));
            };
            toward += (*centre - point.position).normalize_or_zero();
        }
        surface.positions.push(point.position);
        surface.colours.push(point.colour);
        surface.toward_cameras.push(toward.normalize_or_zero());
    }
    // Nothing is left out here: who saw which point is known by its number.
    let surface = Surface::Points(surface);
    checks::sound(path, &surface).map(|()| surface)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, the coefficients of a lens would be taken for one another: each model at one point, by the formulae of
    /// COLMAP's `models.h` written out, with a different number for every parameter.
    #[test]
    fn every_model_bends_as_colmap_says() {
        let (u, v) = (0.4f64, -0.3f64);
        let r2 = u * u + v * v;
        let r = r2.sqrt();
        let theta = r.atan();
        let (fu, fv) = (u * theta / r, v * theta / r);
        let t2 = theta * theta;
        let series = |k: &[f64], x: f64| k.iter().rev().fold(0.0, |sum, k| (sum + k) * x);
        let tangent = |x: f64, y: f64, p1: f64, p2: f64| {
            let r2 = x * x + y * y;
            (2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y))
        };
        let full = (1.0 + series(&[0.1, 0.02, 0.03], r2)) / (1.0 + series(&[0.04, 0.05, 0.06], r2));
        let (tu, tv) = tangent(u, v, 1e-3, 2e-3);
        let (gu, gv) = tangent(fu, fv, 1e-3, 2e-3);
        let prism = 1.0 + series(&[0.1, 0.02, 0.03, 0.04], t2);
        let fov = (2.0 * r * 0.4f64.tan()).atan() / (r * 0.8);
        let six = 1.0 + series(&[0.1, 0.02, 0.03, 0.04, 0.05, 0.06], t2);
        let (su, sv) = (six * fu, six * fv);
        let s2 = su * su + sv * sv;
        let both = 2.0 * (1e-3 * su + 2e-3 * sv);
        let cases: [(&str, &[f64], [f64; 2]); 8] = [
            ("RADIAL", &[0.1, 0.02], [u, v].map(|x| x * (1.0 + series(&[0.1, 0.02], r2)))),
            ("FULL_OPENCV", &[0.1, 0.02, 1e-3, 2e-3, 0.03, 0.04, 0.05, 0.06], [u * full + tu, v * full + tv]),
            ("FOV", &[0.8], [u * fov, v * fov]),
            ("OPENCV_FISHEYE", &[0.1, 0.02, 0.03, 0.04], [fu * prism, fv * prism]),
            ("SIMPLE_RADIAL_FISHEYE", &[0.1], [fu, fv].map(|x| x * (1.0 + 0.1 * t2))),
            ("RADIAL_FISHEYE", &[0.1, 0.02], [fu, fv].map(|x| x * (1.0 + series(&[0.1, 0.02], t2)))),
            (
                "THIN_PRISM_FISHEYE",
                &[0.1, 0.02, 1e-3, 2e-3, 0.03, 0.04, 5e-3, 6e-3],
                [fu * prism + gu + 5e-3 * t2, fv * prism + gv + 6e-3 * t2],
            ),
            (
                "RAD_TAN_THIN_PRISM_FISHEYE",
                &[0.1, 0.02, 0.03, 0.04, 0.05, 0.06, 1e-3, 2e-3, 5e-3, 6e-3, 7e-3, 8e-3],
                [
                    su + both * su + s2 * 1e-3 + 5e-3 * s2 + 6e-3 * s2 * s2,
                    sv + both * sv + s2 * 2e-3 + 7e-3 * s2 + 8e-3 * s2 * s2,
                ],
            ),
        ];
        for (name, distortion, expected) in cases {
            let projection = *PROJECTIONS.iter().find(|p| p.name == name).unwrap();
            let focal: &[f64] = if projection.one_focal { &[100.0] } else { &[100.0, 100.0] };
            let parameters = [focal, &[50.0, 60.0], distortion].concat();
            let lens = Lens::new(projection, [100, 120], &parameters).unwrap();
            let bent = lens.unified().distort(glam::DVec2::new(u, v)).to_array();
            for axis in 0..2 {
                assert!((bent[axis] - expected[axis]).abs() < 1e-12, "{name}: {bent:?} instead of {expected:?}");
            }
        }
    }
}
