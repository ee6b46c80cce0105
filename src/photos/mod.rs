//! Photos that have been taken: posed images with their lenses, and what a reconstruction knows of them.

use std::path::PathBuf;

use crate::scene::camera::Camera;
use crate::scene::lens::{Distortion, Lens};
use crate::scene::surface::Points;

/// A posed photo. Its image may be missing: choosing among poses needs none.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// Name (unique in its set), pose and pinhole; the pinhole is that of the stored image.
    pub camera: Camera,
    /// What the pinhole does not explain.
    pub distortion: Distortion,
    /// The image file; none where it was not found.
    pub image: Option<PathBuf>,
    /// A mask file of the same size, white where the object is.
    pub mask: Option<PathBuf>,
}

/// A capture: photos, and the sparse points where there are any.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhotoSet {
    /// Where it was read from.
    pub path: PathBuf,
    /// The photos, ordered by name.
    pub photos: Vec<Photo>,
    /// Triangulated points in the same world frame; empty where there are none.
    pub points: Points,
    /// Indices into `photos` that each point was seen in; as long as `points`, or empty.
    pub tracks: Vec<Vec<u32>>,
    /// Mean reprojection error of each point in pixels; as long as `points`, or empty.
    pub errors: Vec<f32>,
    /// What was understood, for the user to check: one line each.
    pub notes: Vec<String>,
}

impl Photo {
    /// The lens.
    pub fn lens(&self) -> Lens {
        Lens::new(self.camera.intrinsics, self.distortion)
    }
}

impl PhotoSet {
    /// The cameras, ordered as the photos are.
    pub fn cameras(&self) -> Vec<Camera> {
        self.photos.iter().map(|photo| photo.camera.clone()).collect()
    }
}
