//! COLMAP binary models that camsplat writes: one camera per image size and lens, and coloured points.

use glam::DVec3;

use super::Lens;
use crate::scene::camera::Camera;
use crate::scene::lens;

/// Which cameras see each point: indices into the cameras of the model, one list per point, or no lists at all. Entries beyond
/// the existing cameras or points are left out.
pub(crate) type Tracks<'a> = &'a [Vec<u32>];

/// The lenses of pinhole cameras.
pub fn pinholes(cameras: &[Camera]) -> Vec<Lens> {
    // Every pinhole is a lens of COLMAP's, so that none is lost here.
    cameras.iter().filter_map(|camera| Lens::of(camera.intrinsics, lens::Distortion::default())).collect()
}

/// The distinct ones of `lenses` in order of appearance, and for each the number of its own, from 1.
fn distinct(lenses: &[Lens]) -> (Vec<&Lens>, Vec<u32>) {
    let mut found: Vec<&Lens> = Vec::new();
    let mut own = Vec::with_capacity(lenses.len());
    for lens in lenses {
        let place = found.iter().position(|other| *other == lens).unwrap_or_else(|| {
            found.push(lens);
            found.len() - 1
        });
        own.push(place as u32 + 1);
    }
    (found, own)
}

/// The tracks without cameras that do not exist, or that their point lies beside or behind: it has no pixel there.
fn in_front(cameras: &[Camera], positions: &[DVec3], tracks: Tracks) -> Vec<Vec<u32>> {
    let sees = |position: DVec3, camera: u32| {
        cameras.get(camera as usize).is_some_and(|camera| {
            let forward = camera.pose.rotation * DVec3::Z;
            forward.dot(position - camera.pose.position) > 0.0
        })
    };
    let pairs = positions.iter().zip(tracks);
    pairs.map(|(&position, track)| track.iter().copied().filter(|&camera| sees(position, camera)).collect()).collect()
}

/// Bytes of cameras.bin; cameras are numbered from 1.
pub fn cameras(lenses: &[Lens]) -> Vec<u8> {
    let (lenses, _) = distinct(lenses);
    let mut bytes = (lenses.len() as u64).to_le_bytes().to_vec();
    for (id, lens) in (1u32..).zip(lenses) {
        bytes.extend(id.to_le_bytes());
        bytes.extend(lens.projection.id.to_le_bytes());
        bytes.extend(u64::from(lens.intrinsics.width).to_le_bytes());
        bytes.extend(u64::from(lens.intrinsics.height).to_le_bytes());
        lens.parameters().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}

/// Bytes of images.bin; images are numbered from 1 in the order of `cameras`, which have a lens each, and named by
/// [`Camera::image_name`]. An observation is the projection of a point whose track holds the camera and that lies before it.
pub fn images(cameras: &[Camera], lenses: &[Lens], positions: &[DVec3], tracks: Tracks) -> Vec<u8> {
    let (_, own) = distinct(lenses);
    let tracks = in_front(cameras, positions, tracks);
    let mut seen: Vec<Vec<(u64, DVec3)>> = vec![Vec::new(); cameras.len()];
    for ((id, &position), track) in (1..).zip(positions).zip(&tracks) {
        for &camera in track {
            seen[camera as usize].push((id, position));
        }
    }
    let mut bytes = (cameras.len() as u64).to_le_bytes().to_vec();
    for ((((id, camera), number), seen), lens) in (1u32..).zip(cameras).zip(own).zip(seen).zip(lenses) {
        let rotation = camera.pose.rotation.conjugate();
        let translation = -(rotation * camera.pose.position);
        bytes.extend(id.to_le_bytes());
        for number in [rotation.w, rotation.x, rotation.y, rotation.z, translation.x, translation.y, translation.z] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend(number.to_le_bytes());
        bytes.extend(camera.image_name().bytes().filter(|&b| b != 0));
        bytes.push(0);
        bytes.extend((seen.len() as u64).to_le_bytes());
        let k = &lens.intrinsics;
        let distortion = lens.unified();
        for (point, position) in seen {
            let p = rotation * position + translation;
            let bent = distortion.distort(p.truncate() / p.z);
            for axis in 0..2 {
                bytes.extend((k.focal[axis] * bent[axis] + k.principal[axis]).to_le_bytes());
            }
            bytes.extend(point.to_le_bytes());
        }
    }
    bytes
}

/// Bytes of points3D.bin; points are numbered from 1. Points without a colour are mid grey. The reprojection error is
/// written as 0: the tracks are projections, not measurements.
pub fn points(positions: &[DVec3], colours: &[[u8; 3]], cameras: &[Camera], tracks: Tracks) -> Vec<u8> {
    let tracks = in_front(cameras, positions, tracks);
    // Observations of an image are numbered in the order in which `images` writes them: by point.
    let mut next = vec![0u32; cameras.len()];
    let mut bytes = (positions.len() as u64).to_le_bytes().to_vec();
    for (i, position) in positions.iter().enumerate() {
        bytes.extend((i as u64 + 1).to_le_bytes());
        position.to_array().iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.extend(colours.get(i).copied().unwrap_or([128; 3]));
        bytes.extend(0f64.to_le_bytes());
        let track = tracks.get(i).map_or(&[][..], Vec::as_slice);
        bytes.extend((track.len() as u64).to_le_bytes());
        for &camera in track {
            let observation = &mut next[camera as usize];
            bytes.extend((camera + 1).to_le_bytes());
            bytes.extend(observation.to_le_bytes());
            *observation += 1;
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::{Image, binary, cameras_of};
    use super::*;
    use crate::files::io::left_out::LeftOut;
    use crate::scene::camera::{Intrinsics, Pose};

    fn set() -> Vec<Camera> {
        let camera = |name: &str, x: f64, width| Camera {
            name: name.into(),
            pose: Pose::looking(DVec3::new(x, 0.5, -4.0), DVec3::new(-x, 0.0, 4.0), DVec3::Y),
            intrinsics: Intrinsics::from_fov(width, 480, 1.0),
        };
        vec![camera("0000.png", 0.0, 640), camera("0001.png", 1.0, 640), camera("0002.png", -2.0, 320)]
    }

    /// If this failed, a trainer would see other cameras than were planned.
    #[test]
    fn cameras_survive_a_round_trip() {
        let written = set();
        let path = Path::new("model.bin");
        let left_out = &mut LeftOut::default();
        let lenses = binary::cameras(path, &cameras(&pinholes(&written)), left_out).unwrap();
        assert_eq!(lenses.len(), 2, "equal lenses are shared");
        let images = binary::images(path, &images(&written, &pinholes(&written), &[], &[])).unwrap();
        let read = cameras_of(&lenses, &images);
        for (a, b) in written.iter().zip(&read) {
            assert_eq!((&a.name, a.intrinsics), (&b.name, b.intrinsics));
            assert!((a.pose.position - b.pose.position).length() < 1e-12);
            assert!(a.pose.rotation.dot(b.pose.rotation).abs() > 1.0 - 1e-12);
        }
    }

    /// If this failed, photos would be written with another lens than they were taken with.
    #[test]
    fn every_model_survives_a_round_trip() {
        let camera = &set()[0];
        // The last is no lens.
        for projection in
            super::super::PROJECTIONS.into_iter().filter(|projection| projection.name != "EQUIRECTANGULAR")
        {
            let count = projection.parameters - if projection.one_focal { 3 } else { 4 };
            let distortion = (1..=count).map(|i| 0.01 * i as f64).collect();
            let lens = Lens { projection, intrinsics: camera.intrinsics, distortion };
            let written = Lens::of(lens.intrinsics, lens.unified()).unwrap_or_else(|| panic!("{}", projection.name));
            let path = Path::new("model.bin");
            let read = binary::cameras(path, &cameras(&[written]), &mut LeftOut::default()).unwrap();
            assert_eq!(read[&1].unified(), lens.unified(), "{}", projection.name);
        }
        let prism = lens::Distortion { prism: [0.1, 0.0, 0.0, 0.0], ..lens::Distortion::default() };
        assert_eq!(Lens::of(camera.intrinsics, prism), None);
    }

    /// If this failed, observations and tracks would contradict each other, and trainers that use them would crash.
    #[test]
    fn tracks_and_observations_refer_to_each_other() {
        let cameras = set();
        let positions = [DVec3::ZERO, DVec3::new(0.1, 0.2, 0.3)];
        let tracks = [vec![0, 1], vec![1, 2]];
        let path = Path::new("model.bin");
        let read = binary::points(path, &points(&positions, &[[1, 2, 3]], &cameras, &tracks)).unwrap();
        assert_eq!(
            (read[0].position, read[0].colour, &read[0].track),
            (positions[0], [1, 2, 3], &vec![[1, 0], [2, 0]])
        );
        assert_eq!((read[1].position, read[1].colour, &read[1].track), (positions[1], [128; 3], &vec![[2, 1], [3, 0]]));
        // The second point is the second observation of the second image: the last eight bytes of the third entry.
        let bytes = points(&positions, &[], &cameras, &tracks);
        assert_eq!(bytes[bytes.len() - 16..], [2, 0, 0, 0, 1, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0]);
        // The first image sees the origin in the middle of its width.
        let bytes = images(&cameras, &pinholes(&cameras), &positions, &tracks);
        assert_eq!(binary::images(path, &bytes).unwrap().len(), 3);
        let name_end = 8 + 4 + 7 * 8 + 4 + "0000.png".len() + 1;
        let x = f64::from_le_bytes(bytes[name_end + 8..name_end + 16].try_into().unwrap());
        assert!((x - 320.0).abs() < 1e-9, "{x}");
    }

    /// If this failed, photos taken through a real lens would be said to show points where a pinhole would, and points behind a camera
    /// be said to be in its photo.
    #[test]
    fn observations_are_pixels_of_the_lens_and_lie_in_front() {
        let camera = Camera {
            name: "0000.png".into(),
            pose: Pose::looking(DVec3::ZERO, DVec3::Z, DVec3::NEG_Y),
            intrinsics: Intrinsics::from_fov(640, 480, 1.0),
        };
        let lens = Lens::of(
            camera.intrinsics,
            lens::Distortion { radial: [0.1, -0.05, 0.0, 0.0, 0.0, 0.0], ..lens::Distortion::default() },
        );
        let (cameras, lenses) = ([camera], [lens.unwrap()]);
        let positions = [DVec3::new(0.5, 0.3, -1.0), DVec3::new(0.5, -0.25, 2.0), DVec3::new(1.0, 0.0, 0.0)];
        let tracks = [vec![0], vec![0], vec![0, 7]];
        let bytes = images(&cameras, &lenses, &positions, &tracks);
        let at = 8 + 4 + 7 * 8 + 4 + "0000.png".len() + 1;
        let number = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        assert_eq!(bytes[at..at + 8], 1u64.to_le_bytes(), "the point in front alone");
        // Brown's model by hand: (0.25, -0.125) from the axis.
        let square = 0.25f64.powi(2) + 0.125f64.powi(2);
        let by = 1.0 + 0.1 * square - 0.05 * square * square;
        let k = &cameras[0].intrinsics;
        assert!((number(at + 8) - (320.0 + k.focal[0] * 0.25 * by)).abs() < 1e-9, "{}", number(at + 8));
        assert!((number(at + 16) - (240.0 - k.focal[1] * 0.125 * by)).abs() < 1e-9, "{}", number(at + 16));
        assert_eq!(bytes[at + 24..at + 32], 2u64.to_le_bytes());
        let read = binary::points(Path::new("model.bin"), &points(&positions, &[], &cameras, &tracks)).unwrap();
        let found: Vec<_> = read.iter().map(|point| point.track.clone()).collect();
        assert_eq!(found, [vec![], vec![[1, 0]], vec![]]);
    }

    /// If this failed, an image without a pose would stand at some place, or nowhere.
    #[test]
    fn a_pose_of_no_rotation_is_none() {
        let image = |stored| Image { id: 1, lens: 1, name: "a".into(), stored, observations: Vec::new() };
        assert!(image(([0.0; 4], [0.0; 3])).pose().is_none());
        assert!(image(([1.0, 0.0, 0.0, 0.0], [f64::NAN, 0.0, 0.0])).pose().is_none());
    }
}
