//! Cameras: a pose (world-from-camera, OpenCV axes) and pinhole intrinsics.

use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::least_spread::direction_of_least_variance;
use super::stray::Reach;

/// Pinhole intrinsics in pixels; pixel (0, 0) is the top-left corner of the image, so its centre is (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Image width in pixels.
    pub width: u32,
    /// Image height in pixels.
    pub height: u32,
    /// Focal lengths in pixels (x, y).
    pub focal: [f64; 2],
    /// Principal point in pixels (x, y).
    pub principal: [f64; 2],
}

/// The lens in the middle of those of cameras, by field of view; none of none.
pub fn middle_lens(cameras: &[Camera]) -> Option<Intrinsics> {
    let mut lenses: Vec<&Intrinsics> = cameras.iter().map(|camera| &camera.intrinsics).collect();
    lenses.sort_by(|a, b| a.fov()[0].total_cmp(&b.fov()[0]));
    lenses.get(lenses.len() / 2).map(|lens| **lens)
}

impl Intrinsics {
    /// Square pixels and a centred principal point, from the image size and the horizontal field of view in radians.
    pub fn from_fov(width: u32, height: u32, fov_x: f64) -> Self {
        let f = 0.5 * width as f64 / (0.5 * fov_x).tan();
        Self { width, height, focal: [f, f], principal: [0.5 * width as f64, 0.5 * height as f64] }
    }

    /// The same lens for an image of another size, stretched with it; none where the shapes of the two images differ by more
    /// than a pixel of rounding.
    pub fn resized(&self, width: u32, height: u32) -> Option<Self> {
        let (w, h) = (f64::from(self.width), f64::from(self.height));
        let (x, y) = (f64::from(width) / w, f64::from(height) / h);
        let off = (f64::from(height) - h * x).abs().min((f64::from(width) - w * y).abs());
        (off <= 1.0).then(|| self.stretched(width, height))
    }

    /// The same lens for an image of any other shape.
    fn stretched(&self, width: u32, height: u32) -> Self {
        let [x, y] = [(width, self.width), (height, self.height)].map(|(new, old)| f64::from(new) / f64::from(old));
        Self {
            width,
            height,
            focal: [self.focal[0] * x, self.focal[1] * y],
            principal: [self.principal[0] * x, self.principal[1] * y],
        }
    }

    /// The same lens for an image whose longer side has so many pixels.
    pub fn with_longest(&self, pixels: u32) -> Self {
        let factor = f64::from(pixels) / f64::from(self.width.max(self.height).max(1));
        let size = |size: u32| ((f64::from(size) * factor).round() as u32).max(1);
        self.stretched(size(self.width), size(self.height))
    }

    /// The same lens where each pixel represents a square of `factor` x `factor` pixels; what is left over at the right and at
    /// the bottom is cut off, unless nothing would remain.
    pub fn shrunk(&self, factor: u32) -> Self {
        let size = |size: u32| (size / factor).max(1);
        let scaled = |values: [f64; 2]| values.map(|value| value / f64::from(factor));
        Self {
            width: size(self.width),
            height: size(self.height),
            focal: scaled(self.focal),
            principal: scaled(self.principal),
        }
    }

    /// Full horizontal and vertical fields of view in radians.
    pub fn fov(&self) -> [f64; 2] {
        let full = |size: u32, f: f64, c: f64| (c / f).atan() + ((size as f64 - c) / f).atan();
        [full(self.width, self.focal[0], self.principal[0]), full(self.height, self.focal[1], self.principal[1])]
    }

    /// Tangent of half the wider field of view.
    pub fn widest(&self) -> f64 {
        let [x, y] = self.fov();
        (0.5 * x.max(y)).tan()
    }

    /// Full angle in radians of the widest cone about the optical axis that lies inside the image.
    pub fn inscribed_cone(&self) -> f64 {
        let [fx, fy] = self.focal;
        let [cx, cy] = self.principal;
        let half = [cx / fx, (self.width as f64 - cx) / fx, cy / fy, (self.height as f64 - cy) / fy];
        2.0 * half.into_iter().fold(f64::INFINITY, f64::min).max(0.0).atan()
    }
}

/// A pose, world-from-camera: `x_world = rotation * x_camera + position`, camera axes X right, Y down, Z forward.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Camera centre in the world.
    pub position: DVec3,
    /// World-from-camera rotation, unit length.
    pub rotation: DQuat,
}

impl Pose {
    /// The pose at `position` that looks along `direction` with the image's up as close to `up` as it can be.
    /// Where the two are parallel, an arbitrary but fixed roll is taken.
    pub fn looking(position: DVec3, direction: DVec3, up: DVec3) -> Self {
        let z = direction.normalize();
        let side = z.cross(up);
        let x = if side.length_squared() > 1e-12 { side.normalize() } else { z.any_orthonormal_vector() };
        let y = z.cross(x);
        Self { position, rotation: DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize() }
    }

    /// Unit viewing direction in the world.
    pub fn forward(&self) -> DVec3 {
        self.rotation * DVec3::Z
    }

    /// Unit direction of the image's up in the world.
    pub fn up(&self) -> DVec3 {
        self.rotation * DVec3::NEG_Y
    }
}

/// The point nearest to all viewing axes but those of stray poses, in the least-squares sense; none where the axes are all but
/// parallel: where the determinant of the mean projection across them is at most `parallel`.
pub(crate) fn looked_at(poses: &[Pose], parallel: f64) -> Option<DVec3> {
    let reach = Reach::of(&poses.iter().map(|pose| pose.position).collect::<Vec<_>>());
    // The sum of the projections across the axes, and what they make of the positions.
    let (mut across, mut offset, mut count) = (DMat3::ZERO, DVec3::ZERO, 0.0f64);
    for pose in poses.iter().filter(|pose| reach.holds(pose.position)) {
        let axis = pose.forward();
        let projection = DMat3::IDENTITY - DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        across += projection;
        offset += projection * pose.position;
        count += 1.0;
    }
    (across.determinant() > parallel * count.powi(3)).then(|| across.inverse() * offset)
}

/// Length of a mean direction from which on directions agree: they are within some 37 degrees of it.
const AGREED: f64 = 0.8;

/// The direction that cameras hold up in the mean. Such that look down and are turned to several sides hold up nothing in common: theirs is
/// the one to which their images' sides are level. None where they agree on none.
pub(crate) fn common_up(poses: &[Pose]) -> Option<DVec3> {
    let up = mean_of(poses, Pose::up);
    if up.length() >= AGREED {
        return up.try_normalize();
    }
    let side = |pose: &Pose| pose.rotation * DVec3::X;
    let sides: DMat3 = poses.iter().map(side).map(|s| DMat3::from_cols(s * s.x, s * s.y, s * s.z)).sum();
    let level = direction_of_least_variance(sides);
    let upward = [up, -mean_of(poses, Pose::forward)].map(|mean| mean.dot(level));
    // Which of its two ends is up, by whichever says it more clearly.
    match upward.into_iter().max_by(|a, b| a.abs().total_cmp(&b.abs())) {
        Some(along) if along.abs() > 0.5 * AGREED => Some(along.signum() * level),
        _ => up.try_normalize(),
    }
}

/// Whether cameras all look about the same way and hold about the same direction up: ahead, or down with about one heading.
pub(crate) fn parallel(poses: &[Pose]) -> bool {
    [Pose::up, Pose::forward].into_iter().all(|of| mean_of(poses, of).length() > AGREED)
}

fn mean_of(poses: &[Pose], of: fn(&Pose) -> DVec3) -> DVec3 {
    poses.iter().map(of).sum::<DVec3>() / poses.len().max(1) as f64
}

/// A camera: pose, intrinsics and a name (the image's file name where it has one).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Name, unique in its set.
    pub name: String,
    /// Its position and orientation.
    pub pose: Pose,
    /// How it maps directions to pixels.
    pub intrinsics: Intrinsics,
}

impl Camera {
    /// File name of a camera's image, relative to `images/`: its name, with `.png` where that has no extension.
    pub fn image_name(&self) -> String {
        let known = ["png", "jpg", "jpeg", "tif", "tiff", "exr", "webp"];
        let extension = self.name.rsplit_once('.').map(|(_, extension)| extension.to_lowercase());
        match extension.is_some_and(|e| known.contains(&e.as_str())) {
            true => self.name.clone(),
            false => format!("{}.png", self.name),
        }
    }

    /// Whether a world point lies in front of the camera and inside its image.
    pub fn sees(&self, point: DVec3) -> bool {
        let p = self.pose.rotation.inverse() * (point - self.pose.position);
        let Intrinsics { width, height, focal, principal } = self.intrinsics;
        let x = focal[0] * p.x / p.z + principal[0];
        let y = focal[1] * p.y / p.z + principal[1];
        p.z > 0.0 && (0.0..width as f64).contains(&x) && (0.0..height as f64).contains(&y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn looking(headings: &[f64], pitch: f64, up: DVec3) -> Vec<Pose> {
        let (across, along) = up.any_orthonormal_pair();
        let pose = |heading: &f64| {
            let (sin, cos) = heading.to_radians().sin_cos();
            let (down, level) = (-pitch).to_radians().sin_cos();
            let toward = cos * along + sin * across;
            // Image up by hand: straight down it is the heading.
            let (forward, image_up) = (level * toward - down * up, down * toward + level * up);
            let rotation = DQuat::from_mat3(&DMat3::from_cols(forward.cross(image_up), -image_up, forward));
            Pose { position: DVec3::ZERO, rotation }
        };
        headings.iter().map(pose).collect()
    }

    /// If this failed, photos of a drone that looks straight down would be taken for photos of walls, or those of an orbit from above tilted.
    #[test]
    fn up_is_found_wherever_cameras_look() {
        let up = DVec3::new(0.2, -0.9, 0.4).normalize();
        for pitch in [-90.0, -89.9, -75.0, -60.0, -20.0, 0.0, 40.0] {
            let poses = looking(&[0.0, 90.0, 200.0, 90.0, 310.0], pitch, up);
            let found = common_up(&poses).unwrap();
            let leaning = found.angle_between(up).to_degrees();
            // Where all hold up the same thing, their mean leans to where most look.
            assert!(leaning < if pitch.abs() < 37.0 { 15.0 } else { 1e-6 }, "{pitch}: {leaning} degrees off");
            assert!(!parallel(&poses));
        }
        let mut aslant = looking(&[0.0, 90.0, 200.0, 90.0, 0.0], -90.0, up);
        aslant.extend(looking(&[90.0], -60.0, up));
        assert!(common_up(&aslant).unwrap().angle_between(up) < 1e-6);
        for headings in [&[90.0][..], &[90.0, 90.0], &[60.0, 90.0, 120.0]] {
            assert!([-90.0, -70.0, 0.0].iter().all(|pitch| parallel(&looking(headings, *pitch, up))), "{headings:?}");
        }
    }
}
