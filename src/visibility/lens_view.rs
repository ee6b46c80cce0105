//! Posed lenses as the device has them (`photogrammetry/vds/lens.glsl`).

use glam::DVec3;

use crate::files::photos::Photo;
use crate::scene::similarity::Similarity;

crate::gpu_struct! {
    /// A posed lens in the frame that rays are cast in; see [`Distortion`](crate::scene::lens::Distortion).
    pub struct LensView {
        /// Centre of the camera.
        pub position: [f32; 3],
        /// Radius |(x/z, y/z)| past which directions are outside the lens.
        pub limit: f32,
        /// The image's x axis, unit length.
        pub right: [f32; 3],
        /// The FOV model's angle; zero for every other.
        pub fov: f32,
        /// The image's y axis, unit length.
        pub down: [f32; 3],
        /// 1: the radius is an angle.
        pub fisheye: u32,
        /// Unit viewing direction.
        pub forward: [f32; 3],
        /// 1: tangential and prism terms are taken of the radially distorted point.
        pub after_radial: u32,
        /// Focal lengths in pixels.
        pub focal: [f32; 2],
        /// Principal point in pixels.
        pub principal: [f32; 2],
        /// Image size in pixels.
        pub size: [f32; 2],
        /// Tangential terms.
        pub tangential: [f32; 2],
        /// Prism terms.
        pub prism: [f32; 4],
        /// Factors in the denominator.
        pub rational: [f32; 3],
        /// The division model's k; zero for every other.
        pub division: f32,
        /// Factors in the numerator.
        pub radial: [f32; 6],
        /// Alpha and beta of the enhanced unified model; zero for every other.
        pub unified: [f32; 2],
    }
}

impl LensView {
    /// The camera of a photo in another frame than the world.
    pub fn new(photo: &Photo, to_internal: &Similarity) -> Self {
        let pose = to_internal.pose(&photo.camera.pose);
        let intrinsics = &photo.camera.intrinsics;
        let distortion = &photo.distortion;
        let axis = |axis: DVec3| (pose.rotation * axis).as_vec3().to_array();
        Self {
            position: pose.position.as_vec3().to_array(),
            limit: photo.lens().limit().min(1e30) as f32,
            right: axis(DVec3::X),
            fov: distortion.fov as f32,
            down: axis(DVec3::Y),
            fisheye: u32::from(distortion.fisheye),
            forward: axis(DVec3::Z),
            after_radial: u32::from(distortion.after_radial),
            focal: intrinsics.focal.map(|v| v as f32),
            principal: intrinsics.principal.map(|v| v as f32),
            size: [intrinsics.width as f32, intrinsics.height as f32],
            tangential: distortion.tangential.map(|v| v as f32),
            prism: distortion.prism.map(|v| v as f32),
            rational: distortion.rational.map(|v| v as f32),
            division: distortion.division as f32,
            radial: distortion.radial.map(|v| v as f32),
            unified: distortion.unified.map(|v| v as f32),
        }
    }
}
