//! Conventions of poses: which one a file has, and whether the cameras bear it out.

use std::fmt;

use glam::{DQuat, DVec3};

use super::PhotoSet;
use crate::error::{Error, Result};
use crate::scene::camera::{self, Camera, Pose};

/// What the poses are in a file; here they are world-from-camera with OpenCV axes (X right, Y down, Z forward).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Convention {
    /// A COLMAP model: camera-from-world, OpenCV axes.
    #[default]
    Colmap,
    /// A transforms.json: world-from-camera, OpenGL axes.
    Transforms,
    /// The layout of NSVF: world-from-camera, OpenCV axes.
    Nsvf,
    /// A `.log` trajectory: world-from-camera, OpenCV axes.
    Trajectory,
    /// LLFF's poses_bounds.npy: world-from-camera, axes down, right and backwards.
    Llff,
    /// Cameras of Metashape: world-from-camera, OpenCV axes.
    Metashape,
    /// Cameras of RealityCapture, by angles: world-from-camera, OpenGL axes.
    RealityCapture,
    /// ARKit's, of Polycam or Record3D: world-from-camera, OpenGL axes.
    Phone,
}

impl Convention {
    /// Whether cameras look along -Z in the file.
    fn is_opengl(self) -> bool {
        matches!(self, Self::Transforms | Self::Llff | Self::RealityCapture | Self::Phone)
    }
}

impl fmt::Display for Convention {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Colmap => "COLMAP (camera-from-world, X right, Y down, Z forward)",
            Self::Transforms => "transforms.json (world-from-camera, X right, Y up, -Z forward)",
            Self::Nsvf => "NSVF (world-from-camera, X right, Y down, Z forward)",
            Self::Trajectory => ".log trajectory (world-from-camera, X right, Y down, Z forward)",
            Self::Metashape => "Metashape (world-from-camera, X right, Y down, Z forward)",
            Self::RealityCapture => "RealityCapture (world-from-camera, X right, Y up, -Z forward)",
            Self::Llff => "LLFF (world-from-camera, X down, Y right, -Z forward)",
            Self::Phone => "ARKit (world-from-camera, X right, Y up, -Z forward)",
        })
    }
}

/// A mistake that poses may have been written with: inverse, and Y and Z of the camera turned round.
#[derive(Clone, Copy)]
struct Mistake {
    inverse: bool,
    turned: bool,
}

const NONE: Mistake = Mistake { inverse: false, turned: false };
const MISTAKES: [Mistake; 3] =
    [Mistake { turned: true, ..NONE }, Mistake { inverse: true, ..NONE }, Mistake { inverse: true, turned: true }];

/// Most cameras and most points that are looked at; evenly chosen, they suffice.
const CAMERAS: usize = 200;
const POINTS: usize = 1000;

impl Mistake {
    /// The pose as it would have been without the mistake.
    fn undo(self, convention: Convention, pose: &Pose) -> Pose {
        let turn = |pose: Pose| Pose { rotation: pose.rotation * DQuat::from_rotation_x(std::f64::consts::PI), ..pose };
        let inverse = |pose: Pose| {
            let rotation = pose.rotation.conjugate();
            Pose { position: -(rotation * pose.position), rotation }
        };
        // The matrix in the file, which may be the wrong way about, has the axes that the reader turned from.
        let is_opengl = convention.is_opengl();
        let mut pose = *pose;
        if self.inverse {
            pose = if is_opengl { turn(inverse(turn(pose))) } else { inverse(pose) };
        }
        if self.turned { turn(pose) } else { pose }
    }

    /// What a user should do about it.
    fn remedy(self, convention: Convention) -> String {
        let [down, up] = ["OpenCV (Y down, Z forward)", "OpenGL (Y up, -Z forward)"];
        let axes = if convention == Convention::Transforms { [up, down] } else { [down, up] };
        let ways = ["world-from-camera", "camera-from-world"];
        let ways = if convention == Convention::Colmap { [ways[1], ways[0]] } else { ways };
        let mut wrong = Vec::new();
        if self.inverse {
            wrong.push(format!("{} where this format has {}", ways[1], ways[0]));
        }
        if self.turned {
            wrong.push(format!("in {} axes where this format has {}", axes[1], axes[0]));
        }
        format!("the poses seem to be {}; convert them", wrong.join(", and "))
    }
}

/// Checks that the cameras look at the points: for each camera those of its tracks, or where there are no tracks all of
/// them. Without points, the point nearest to all viewing axes replaces them where cameras are all around it; that
/// cameras look away from it is a warning and no error, since they may be in the middle of a room and look out.
///
/// # Errors
/// When photos show little of the points and another convention explains them far better, or they show nothing. The line
/// names the convention if there is one; so does the warning.
pub fn check_convention(set: &PhotoSet) -> Result<Option<String>> {
    let sample = Sample::new(set);
    let Some(shown) = sample.shown(&NONE) else { return Ok(None) };
    let best = MISTAKES
        .iter()
        .filter_map(|mistake| Some((mistake, sample.shown(mistake)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1).then(std::cmp::Ordering::Greater));
    let best = best.filter(|(_, better)| *better > 3.0 * shown + 0.1);
    let percent = |share: f64| format!("{:.0}%", 100.0 * share);
    match best {
        Some((mistake, _)) if set.points.positions.is_empty() => Ok(Some(format!(
            "the cameras look away from the place that they stand around: right where they look out into a room, but if not, {}",
            mistake.remedy(set.convention)
        ))),
        Some((mistake, better)) => {
            let what = format!(
                "the cameras look away from the points ({} of them in sight, {} otherwise): {}",
                percent(shown),
                percent(better),
                mistake.remedy(set.convention)
            );
            Err(Error::input(&set.path, what))
        }
        None if shown == 0.0 && !set.points.positions.is_empty() => {
            let what = "no camera sees any of the points, and no usual mistake of conventions explains it; check that poses \
                        and points are in one frame";
            Err(Error::input(&set.path, what))
        }
        None => Ok(None),
    }
}

/// Cameras, and what each should see.
struct Sample<'a> {
    set: &'a PhotoSet,
    cameras: Vec<usize>,
    /// Indices of points by camera; empty where every camera should see all of `common`.
    own: Vec<Vec<u32>>,
    common: Vec<DVec3>,
}

impl<'a> Sample<'a> {
    fn new(set: &'a PhotoSet) -> Self {
        let cameras = set.photos.len();
        let cameras: Vec<usize> = (0..cameras).step_by(cameras.div_ceil(CAMERAS).max(1)).collect();
        let points = &set.points.positions;
        let mut own = Vec::new();
        if !set.tracks.is_empty() {
            own = vec![Vec::new(); set.photos.len()];
            for (point, track) in (0..).zip(&set.tracks) {
                track.iter().for_each(|&photo| own[photo as usize].push(point));
            }
        }
        let common = points.iter().step_by(points.len().div_ceil(POINTS).max(1)).copied().collect();
        Self { set, cameras, own, common }
    }

    /// The mean share of points that a camera should see and does, once a mistake is undone; none where there is nothing to
    /// judge by.
    fn shown(&self, mistake: &Mistake) -> Option<f64> {
        let undone = |i: &usize| {
            let camera = &self.set.photos[*i].camera;
            Camera { pose: mistake.undo(self.set.convention, &camera.pose), ..camera.clone() }
        };
        let cameras: Vec<Camera> = self.cameras.iter().map(undone).collect();
        if self.set.points.positions.is_empty() {
            return shown_of_axes(&cameras);
        }
        let (mut sum, mut judged) = (0.0, 0);
        for (camera, &i) in cameras.iter().zip(&self.cameras) {
            let own: Vec<DVec3> = match self.own.get(i) {
                Some(own) => {
                    let step = own.len().div_ceil(POINTS).max(1);
                    own.iter().step_by(step).map(|&point| self.set.points.positions[point as usize]).collect()
                }
                None => self.common.clone(),
            };
            if !own.is_empty() {
                sum += own.iter().filter(|p| camera.sees(**p)).count() as f64 / own.len() as f64;
                judged += 1;
            }
        }
        (judged > 0).then(|| sum / f64::from(judged))
    }
}

/// The share of cameras that look towards the point nearest to all viewing axes; none where they surround nothing: the
/// axes do not meet there to within a tenth of their distance (a walk through a room), or all point much the same way (a
/// flight over land).
fn shown_of_axes(cameras: &[Camera]) -> Option<f64> {
    let at = looked_at(cameras)?;
    let (mut off, mut away, mut towards) = (0.0, 0.0, 0);
    let mean: DVec3 = cameras.iter().map(|camera| camera.pose.forward()).sum::<DVec3>() / cameras.len() as f64;
    for camera in cameras {
        let d = at - camera.pose.position;
        let f = camera.pose.forward();
        off += d.cross(f).length();
        away += d.length();
        towards += usize::from(f.dot(d) > 0.0);
    }
    (cameras.len() >= 3 && mean.length() < 0.8 && off < 0.1 * away).then(|| towards as f64 / cameras.len() as f64)
}

/// The point nearest to all viewing axes but those of stray cameras, in the least-squares sense; none where they are all but
/// parallel.
pub fn looked_at(cameras: &[Camera]) -> Option<DVec3> {
    camera::looked_at(&cameras.iter().map(|camera| camera.pose).collect::<Vec<_>>(), 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::photos::Photo;
    use crate::scene::camera::Intrinsics;
    use crate::scene::lens::Distortion;
    use crate::scene::surface::Points;

    /// Cameras on a tilted circle that look inwards, off the origin, with points about the middle.
    fn capture(convention: Convention, with_points: bool) -> PhotoSet {
        let centre = DVec3::new(3.0, -2.0, 5.0);
        let photos = (0..20)
            .map(|i| {
                let (sin, cos) = (0.3 * f64::from(i)).sin_cos();
                let away = DVec3::new(4.0 * cos, 4.0 * sin, 1.0 + 0.5 * sin);
                let pose = Pose::looking(centre + away, -away, DVec3::Z);
                let intrinsics = Intrinsics::from_fov(640, 480, 1.0);
                let camera = Camera { name: format!("{i:02}.png"), pose, intrinsics };
                Photo { camera, distortion: Distortion::default(), image: None, mask: None }
            })
            .collect();
        let positions =
            (0..50).map(|i| centre + 0.5 * DVec3::new((f64::from(i)).sin(), (2.0 * f64::from(i)).cos(), 0.3));
        let positions = if with_points { positions.collect() } else { Vec::new() };
        PhotoSet { photos, convention, points: Points { positions, ..Points::default() }, ..PhotoSet::default() }
    }

    /// The message for a set whose poses were written with a mistake. Both are their own inverse, and the two together are
    /// applied in the other order.
    fn message(convention: Convention, with_points: bool, mistake: Mistake) -> String {
        let mut set = capture(convention, with_points);
        assert_eq!(check_convention(&set).unwrap(), None);
        for photo in &mut set.photos {
            let Mistake { inverse, turned } = mistake;
            let turned = Mistake { inverse: false, turned }.undo(convention, &photo.camera.pose);
            photo.camera.pose = Mistake { inverse, turned: false }.undo(convention, &turned);
        }
        match check_convention(&set) {
            Ok(warning) => {
                assert!(!with_points, "{warning:?}");
                warning.unwrap()
            }
            Err(refusal) => refusal.to_string(),
        }
    }

    /// If this failed, the commonest mistake with poses would end in empty renders and not in a line that names it.
    #[test]
    fn mistaken_conventions_are_named() {
        for convention in [Convention::Colmap, Convention::Transforms, Convention::Nsvf] {
            let is_opengl = convention.is_opengl();
            let axes = if is_opengl { "to be in OpenCV" } else { "to be in OpenGL" };
            for with_points in [true, false] {
                let text = message(convention, with_points, MISTAKES[0]);
                assert!(text.contains(axes) && !text.contains("from-world"), "{text}");
            }
            let way =
                if convention == Convention::Colmap { "to be world-from-camera" } else { "to be camera-from-world" };
            let text = message(convention, true, MISTAKES[1]);
            assert!(text.contains(way) && !text.contains("axes"), "{text}");
            let text = message(convention, true, MISTAKES[2]);
            assert!(text.contains(way) && text.contains("axes"), "{text}");
        }
    }

    /// If this failed, photos taken outwards from the middle of a room would be refused.
    #[test]
    fn cameras_that_look_outwards_into_a_room_are_fine() {
        let mut set = capture(Convention::Colmap, true);
        for (i, photo) in set.photos.iter_mut().enumerate() {
            let wobble = DVec3::new((7.0 * i as f64).sin(), (5.0 * i as f64).cos(), (3.0 * i as f64).sin());
            let direction = -photo.camera.pose.forward() + 0.3 * wobble;
            let position = DVec3::new(3.0, -2.0, 5.0) + 0.5 * wobble;
            photo.camera.pose = Pose::looking(position, direction, DVec3::Z);
        }
        set.points.positions = (0..400)
            .map(|i| {
                let t = f64::from(i);
                DVec3::new(3.0, -2.0, 5.0) + 5.0 * DVec3::new(t.cos(), t.sin(), 0.5 * (2.3 * t).sin())
            })
            .collect();
        assert_eq!(check_convention(&set).unwrap(), None);
        set.points.positions.clear();
        assert_eq!(check_convention(&set).unwrap(), None);
    }
}
