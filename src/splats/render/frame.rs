//! The training frame, and cameras as the device takes them.

use glam::{DMat3, DVec3};

use crate::files::photos::volume;
use crate::scene::camera::Camera;
use crate::scene::gaussians::Gaussians;
use crate::scene::similarity::Similarity;
use crate::scene::stray::Reach;

/// Depth in the training frame before which nothing is drawn.
pub const NEAR: f32 = 0.01;

/// How much wider than the cameras' circle the extent is, as in 3DGS and gsplat.
const MARGIN: f64 = 1.1;

/// The frame in which Gaussians are trained: the world moved and scaled, so that the mean of the training cameras' positions is
/// the origin and their extent is 1. It is not rotated: rotations and harmonics stay as they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// From the world to the training frame.
    pub to_training: Similarity,
}

impl Frame {
    /// The frame of training cameras. The extent is 1.1 times the largest distance of a camera from their mean, without stray cameras (see
    /// [`Reach::of_cameras`]); of cameras at one position it is the distance to the middle of the points, or the points' radius where that
    /// is larger, and 1 where there are none either.
    pub fn new(cameras: &[Camera], points: &[DVec3]) -> Self {
        let all: Vec<DVec3> = cameras.iter().map(|camera| camera.pose.position).collect();
        let reach = Reach::of_cameras(&all, points);
        let positions = || all.iter().copied().filter(|position| reach.holds(*position));
        let centre = positions().sum::<DVec3>() / positions().count().max(1) as f64;
        let widest = positions().map(|position| position.distance(centre)).fold(0.0, f64::max);
        let away = volume::around_points(points).map_or(0.0, |ball| ball.centre.distance(centre).max(ball.radius));
        let zero = 1e-9 * centre.length();
        // With a smaller extent, the points' coordinates would be too large for single precision.
        let extent = match (widest > zero.max(1e-6 * away), away > zero) {
            (true, _) => MARGIN * widest,
            (false, true) => away,
            (false, false) => 1.0,
        };
        Self { to_training: Similarity::to_unit_sphere(centre, extent) }
    }

    /// The extent in the world's units.
    pub fn extent(&self) -> f64 {
        1.0 / self.to_training.scale
    }

    /// A camera of the world as the device takes it.
    pub fn view(&self, camera: &Camera) -> View {
        let pose = self.to_training.pose(&camera.pose);
        let rows = DMat3::from_quat(pose.rotation);
        // Columns of world-from-camera are rows of its inverse.
        let row = |row: DVec3| row.extend(-row.dot(pose.position)).as_vec4().to_array();
        let narrow = |values: [f64; 2]| values.map(|value| value as f32);
        View {
            row_x: row(rows.x_axis),
            row_y: row(rows.y_axis),
            row_z: row(rows.z_axis),
            position: pose.position.as_vec3().to_array(),
            near: NEAR,
            focal: narrow(camera.intrinsics.focal),
            principal: narrow(camera.intrinsics.principal),
            width: camera.intrinsics.width,
            height: camera.intrinsics.height,
            spare0: 0,
            spare1: 0,
        }
    }

    /// Gaussians of the world in the training frame.
    pub fn gaussians_to_training(&self, gaussians: Gaussians) -> Gaussians {
        gaussians.through(&self.to_training)
    }

    /// Gaussians of the training frame in the world.
    pub fn gaussians_to_world(&self, gaussians: Gaussians) -> Gaussians {
        gaussians.through(&self.to_training.inverse())
    }
}

crate::gpu_struct! {
    /// A camera in the training frame, without distortion. Pixel (0, 0) is the picture's corner: centres are at halves.
    pub struct View {
        /// Camera-from-world: in camera axes (X right, Y down, Z forward) point p is at `row_x . (p, 1)`.
        pub row_x: [f32; 4],
        /// See `row_x`.
        pub row_y: [f32; 4],
        /// See `row_x`; this is the depth.
        pub row_z: [f32; 4],
        /// Camera centre.
        pub position: [f32; 3],
        /// Smallest depth that is drawn.
        pub near: f32,
        /// Focal lengths in pixels.
        pub focal: [f32; 2],
        /// Principal point in pixels.
        pub principal: [f32; 2],
        /// Pixels in a row.
        pub width: u32,
        /// Rows of pixels.
        pub height: u32,
        /// Unused.
        pub spare0: u32,
        /// Unused.
        pub spare1: u32,
    }
}

#[cfg(test)]
mod tests {
    use glam::{DVec2, Vec3};

    use super::*;
    use crate::scene::camera::{Intrinsics, Pose};
    use crate::scene::lens::{Distortion, Lens};

    fn cameras(scale: f64, offset: DVec3) -> Vec<Camera> {
        let camera = |i: u32| {
            let t = f64::from(i);
            let away = DVec3::new(3.0 * t.cos(), 2.0 * t.sin(), 0.4 * (2.0 * t).sin());
            let pose = Pose::looking(offset + scale * away, -away + 0.2 * DVec3::X, DVec3::Z);
            let intrinsics = Intrinsics { width: 640, height: 360, focal: [500.0, 510.0], principal: [310.0, 190.0] };
            Camera { name: format!("{i:02}"), pose, intrinsics }
        };
        (0..9).map(camera).collect()
    }

    fn project(view: &View, p: Vec3) -> DVec2 {
        let along = |row: [f32; 4]| f64::from(Vec3::new(row[0], row[1], row[2]).dot(p) + row[3]);
        let (x, y, depth) = (along(view.row_x), along(view.row_y), along(view.row_z));
        let pixel =
            |axis: usize, value: f64| f64::from(view.focal[axis]) * value / depth + f64::from(view.principal[axis]);
        DVec2::new(pixel(0, x), pixel(1, y))
    }

    /// If this failed, training would fit another scene than the one that the photos show, or write it back elsewhere.
    #[test]
    fn a_point_and_its_image_are_at_the_same_pixel() {
        let cameras = cameras(7.0, DVec3::new(100.0, -30.0, 4.0));
        let frame = Frame::new(&cameras, &[]);
        for camera in &cameras {
            let view = frame.view(camera);
            for p in [DVec3::ZERO, DVec3::new(0.5, -0.3, 1.0), DVec3::new(-1.0, 0.8, 0.2)] {
                let p = DVec3::new(100.0, -30.0, 4.0) + p;
                let local = camera.pose.rotation.inverse() * (p - camera.pose.position);
                let pixel = Lens::new(camera.intrinsics, Distortion::default()).project(local).unwrap();
                let image = frame.to_training.point(p).as_vec3();
                assert!((project(&view, image) - pixel).length() < 1e-3, "{} and {pixel}", project(&view, image));
            }
            let stands = frame.to_training.point(camera.pose.position).as_vec3();
            assert_eq!(Vec3::from(view.position), stands);
            assert_eq!((view.width, view.height, view.near), (640, 360, NEAR));
        }
    }

    /// Computed directly. If this failed, learning rates would not fit the scene, and a scene in millimetres would train otherwise than
    /// the same in metres.
    #[test]
    fn the_extent_is_one_whatever_the_unit() {
        let of = |scale, offset| {
            let cameras = cameras(scale, offset);
            let frame = Frame::new(&cameras, &[]);
            let positions: Vec<DVec3> =
                cameras.iter().map(|camera| frame.to_training.point(camera.pose.position)).collect();
            assert!(positions.iter().sum::<DVec3>().length() < 1e-6);
            let widest = positions.iter().map(|p| p.length()).fold(0.0, f64::max);
            assert!((widest - 1.0 / 1.1).abs() < 1e-6, "{widest}");
            positions
        };
        let one = of(1.0, DVec3::ZERO);
        for other in [of(1e-3, DVec3::X), of(2e4, DVec3::new(5e5, 4e6, 100.0))] {
            assert!(one.iter().zip(&other).all(|(a, b)| a.distance(*b) < 1e-6));
        }
    }

    /// If this failed, one wrong pose would shrink the scene to a speck, and training would learn nothing.
    #[test]
    fn a_stray_pose_does_not_change_the_frame() {
        let mut all: Vec<Camera> = [0.0, 0.1, 0.2].iter().flat_map(|x| cameras(1.0, DVec3::splat(*x))).collect();
        let frame = Frame::new(&all, &[]);
        let mut stray = all[0].clone();
        for far in [1e2, 1e5] {
            stray.pose.position = DVec3::new(far, 1.0, -far);
            all.push(stray.clone());
            assert_eq!(Frame::new(&all, &[]), frame);
        }
    }

    /// If this failed, photos from a tripod, or a single one, would divide by zero.
    #[test]
    fn cameras_in_one_place_take_their_extent_from_the_points() {
        let place = DVec3::new(1e3, 2e3, -3e3) / 7.0;
        for count in [1, 2, 7] {
            let mut cameras = cameras(1.0, DVec3::ZERO);
            cameras.truncate(count);
            cameras.iter_mut().for_each(|camera| camera.pose.position = place);
            let points: Vec<DVec3> = (0..8)
                .map(|i| place + DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1) + 4.0, f64::from(i >> 2)) - 0.5)
                .collect();
            assert!((Frame::new(&cameras, &points).extent() - 4.0).abs() < 1e-6);
            assert_eq!(Frame::new(&cameras, &[]).extent(), 1.0);
            assert_eq!(Frame::new(&cameras, &[cameras[0].pose.position]).extent(), 1.0);
            // In the very middle of the points.
            let about: Vec<DVec3> = [2.0, -2.0].map(|x| place + DVec3::new(x, 0.0, 0.0)).to_vec();
            assert!((Frame::new(&cameras, &about).extent() - 2.0).abs() < 1e-6);
        }
        assert_eq!(Frame::new(&[], &[]).to_training, Similarity::IDENTITY);
    }

    /// If this failed, a trained file would be of another size than the scene, or drift with every round trip.
    #[test]
    fn gaussians_go_there_and_back() {
        let frame = Frame::new(&cameras(7.0, DVec3::ONE), &[]);
        let world = Gaussians {
            centres: vec![DVec3::new(3.0, -2.0, 1.0)],
            log_scales: vec![[0.0, -1.0, -2.5]],
            rotations: vec![[0.5, 0.1, -0.2, 0.9]],
            opacities: vec![0.3],
            degree: 0,
            harmonics: vec![0.1, 0.2, 0.3],
            antialiased: false,
        };
        let trained = frame.gaussians_to_training(world.clone());
        assert_eq!(trained.centres[0], frame.to_training.point(world.centres[0]));
        assert!((f64::from(trained.log_scales[0][0].exp()) * frame.extent() - 1.0).abs() < 1e-6);
        assert_eq!((&trained.rotations, &trained.harmonics), (&world.rotations, &world.harmonics));
        let back = frame.gaussians_to_world(trained);
        assert!(back.centres[0].distance(world.centres[0]) < 1e-12);
        assert!(back.log_scales[0].iter().zip(world.log_scales[0]).all(|(a, b)| (a - b).abs() < 1e-6));
    }
}
