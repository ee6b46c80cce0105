//! Photos that have been taken: posed images with their lenses, and what a reconstruction knows of them.

mod convention;
pub(crate) mod decode;
mod describe;
mod header;
pub(crate) mod orientation;
pub mod preview;
mod space;
pub mod volume;

use std::path::PathBuf;

use glam::DQuat;

pub use self::convention::{Convention, check_convention, looked_at};
pub use self::describe::describe;
pub use self::header::Header;
use crate::scene::camera::{Camera, Pose};
use crate::scene::lens::{Distortion, Lens};
use crate::scene::stray::Reach;
use crate::scene::surface::Points;

/// A posed photo. Its image may be missing: choosing among poses needs none.
#[derive(Clone, Debug, PartialEq)]
pub struct Photo {
    /// Name (unique in its set), pose and pinhole; the pinhole is that of the stored image.
    pub camera: Camera,
    /// What the pinhole does not explain.
    pub distortion: Distortion,
    /// The image file; none where it was not found or cannot be read.
    pub image: Option<PathBuf>,
    /// A mask file of the same shape, white where the object is. Without one, the image may have an alpha channel.
    pub mask: Option<PathBuf>,
}

/// A capture: photos, and the sparse points where there are any.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PhotoSet {
    /// Where it was read from.
    pub path: PathBuf,
    /// The photos, ordered by name.
    pub photos: Vec<Photo>,
    /// What the poses were in the file.
    pub convention: Convention,
    /// Triangulated points in the same world frame; empty where there are none.
    pub points: Points,
    /// Indices into `photos` that each point was seen in; as long as `points`, or empty.
    pub tracks: Vec<Vec<u32>>,
    /// Mean reprojection error of each point in pixels; as long as `points`, or empty.
    pub errors: Vec<f32>,
    /// How long a metre is in its units; none where that is not known.
    pub metre: Option<f64>,
    /// Two photos, by their names, that a step of the photographer lies between; none where all of them say how long that is.
    pub apart: Option<[String; 2]>,
    /// Images that were not found, and files that cannot be read, with the reason.
    pub missing: Vec<String>,
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

    /// Indices of the photos that `counts` holds for, those first that were taken nearest to a camera and most as it looks: a `step` counts
    /// as much as 30 degrees.
    pub fn nearest(&self, camera: &Camera, step: f64, counts: impl Fn(&Photo) -> bool) -> Vec<usize> {
        let away = |photo: &Photo| {
            let turned = photo.camera.pose.forward().angle_between(camera.pose.forward()).to_degrees();
            photo.camera.pose.position.distance(camera.pose.position) / step + turned / 30.0
        };
        let counted = self.photos.iter().enumerate().filter(|(_, photo)| counts(photo));
        let mut photos: Vec<(f64, usize)> = counted.map(|(i, photo)| (away(photo), i)).collect();
        photos.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        photos.into_iter().map(|(_, photo)| photo).collect()
    }

    /// Within which photos are not stray; see [`Reach::of_cameras`].
    pub fn reach(&self) -> Reach {
        let positions: Vec<_> = self.photos.iter().map(|photo| photo.camera.pose.position).collect();
        Reach::of_cameras(&positions, &self.points.positions)
    }

    /// How many photos mark what belongs to the object, by masks or alpha.
    pub fn cut_out(&self) -> usize {
        let marks = |photo: &&Photo| {
            let header = photo.image.as_deref().and_then(|file| Header::read(file).ok());
            photo.mask.is_some() || header.is_some_and(|header| header.alpha)
        };
        self.photos.iter().filter(marks).count()
    }

    /// Whether there are points to take for surfaces. Where the capture tells which photos saw a point and none saw any, they are
    /// hardly triangulated: models of rendered pictures often have random ones.
    pub fn has_surface_points(&self) -> bool {
        let seen = self.tracks.is_empty() || self.tracks.iter().any(|track| !track.is_empty());
        seen && !self.points.positions.is_empty()
    }

    /// The set in a frame that is turned: what was in a direction is in that direction turned.
    pub fn turned(mut self, turn: DQuat) -> Self {
        for photo in &mut self.photos {
            let Pose { position, rotation } = photo.camera.pose;
            photo.camera.pose = Pose { position: turn * position, rotation: (turn * rotation).normalize() };
        }
        let Points { positions, normals, toward_cameras, .. } = &mut self.points;
        positions.iter_mut().chain(normals).chain(toward_cameras).for_each(|vector| *vector = turn * *vector);
        self
    }

    /// The set with only the points that any of its photos sees; with all, where nothing says which photos see them.
    pub fn with_points_seen(mut self) -> Self {
        if self.tracks.is_empty() {
            return self;
        }
        let seen: Vec<bool> = self.tracks.iter().map(|track| !track.is_empty()).collect();
        self.points = self.points.filtered(&seen);
        let mut kept = seen.iter();
        self.tracks.retain(|track| !track.is_empty());
        self.errors.retain(|_| *kept.next().unwrap_or(&true));
        self
    }

    /// The set with only the photos in `keep`. All points stay; tracks lose the photos that are gone.
    pub fn filtered(mut self, keep: impl Fn(&Photo) -> bool) -> Self {
        let kept: Vec<bool> = self.photos.iter().map(keep).collect();
        let mut next = 0;
        let numbers: Vec<Option<u32>> = kept
            .iter()
            .map(|kept| {
                next += u32::from(*kept);
                kept.then(|| next - 1)
            })
            .collect();
        for track in &mut self.tracks {
            *track = track.iter().filter_map(|&photo| numbers[photo as usize]).collect();
        }
        let mut kept = kept.into_iter();
        self.photos.retain(|_| kept.next().unwrap_or_default());
        self
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// If this failed, random points of a rendered capture would start as a wide fog (lego over black: 32.7 in place of 36.2 dB), or
    /// triangulated ones, and those of files that tell of no tracks, as dust.
    #[test]
    fn points_that_no_photo_saw_are_no_surface() {
        let set = |count: usize, tracks: &[&[u32]]| PhotoSet {
            points: Points { positions: vec![DVec3::ONE; count], ..Points::default() },
            tracks: tracks.iter().map(|track| track.to_vec()).collect(),
            ..PhotoSet::default()
        };
        assert!(!set(0, &[]).has_surface_points());
        assert!(set(2, &[]).has_surface_points());
        assert!(!set(2, &[&[], &[]]).has_surface_points());
        assert!(set(2, &[&[], &[0, 3]]).has_surface_points());
    }
}
