//! Writing transforms.json.

use std::collections::BTreeMap;

use glam::DMat3;
use serde_json::{Value, json};

use crate::files::photos::Photo;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::lens::Distortion;

/// The entries of a frame or of the file.
type Entries = BTreeMap<&'static str, Value>;

/// A camera, its distortion, and the paths of its image and, where there is one, of its mask.
type View<'a> = (&'a Camera, Distortion, String, Option<String>);

/// The text of a transforms.json in nerfstudio's dialect, which instant-ngp reads as well: OpenGL camera-to-world
/// matrices in the untouched world frame, `camera_model` OPENCV without distortion (some loaders refuse PINHOLE), and
/// both camera angles (some need them where images are not square). Images are named `images/` and
/// [`Camera::image_name`]. Intrinsics are at the top where all cameras share them, else in each frame.
/// `ply_file_path` is the seed cloud, relative to the file, where there is one.
pub fn write(cameras: &[Camera], ply_file_path: Option<&str>) -> String {
    let views: Vec<View> =
        cameras.iter().map(|camera| (camera, Distortion::default(), image_path(camera), None)).collect();
    text(&views, ply_file_path)
}

/// As [`write()`], for photos: with their distortion, as OPENCV or OPENCV_FISHEYE, and with `masks/NAME.png` for each where any of them has a
/// mask, since nerfstudio refuses masks for some. The second value is for the notes: how many lenses the format cannot express, which are written
/// as pinholes, and whether fisheyes and others are mixed.
pub fn write_photos(photos: &[&Photo], ply_file_path: Option<&str>) -> (String, Vec<String>) {
    let has_masks = photos.iter().any(|photo| photo.mask.is_some());
    let mask = |photo: &Photo| has_masks.then(|| format!("masks/{}.png", photo.camera.image_name()));
    write_photos_at(photos, ply_file_path, |photo| (image_path(&photo.camera), mask(photo)))
}

/// As [`write_photos()`], with the paths of each photo's image and mask as `paths` gives them.
pub fn write_photos_at(
    photos: &[&Photo],
    ply_file_path: Option<&str>,
    paths: impl Fn(&Photo) -> (String, Option<String>),
) -> (String, Vec<String>) {
    let mut beyond = 0;
    let views: Vec<View> = photos
        .iter()
        .map(|photo| {
            let fits = expressible(&photo.distortion);
            beyond += usize::from(!fits);
            let distortion = if fits { photo.distortion } else { Distortion::default() };
            let (image, mask) = paths(photo);
            (&photo.camera, distortion, image, mask)
        })
        .collect();
    let mut notes = Vec::new();
    if beyond > 0 {
        notes.push(format!(
            "transforms.json cannot express the lenses of {beyond} of {} photos: they stand in it as pinholes; train \
             from the COLMAP model",
            photos.len()
        ));
    }
    let fisheyes = views.iter().filter(|view| view.1.fisheye).count();
    if fisheyes > 0 && fisheyes < views.len() {
        notes.push(format!(
            "transforms.json says OPENCV of the whole set, as loaders look for one model: the {fisheyes} fisheye photos of \
             {} are misread by those that do not look at each frame; train from the COLMAP model",
            photos.len()
        ));
    }
    (text(&views, ply_file_path), notes)
}

/// Whether OPENCV (k1 to k3, p1, p2: nerfstudio refuses a fourth) or OPENCV_FISHEYE (k1 to k4) holds the distortion.
fn expressible(distortion: &Distortion) -> bool {
    let Distortion { fisheye, fov, division, unified, radial, rational, tangential, prism, .. } = distortion;
    let perspective = *fov == 0.0 && *division == 0.0 && *unified == [0.0; 2];
    let bare = perspective && *rational == [0.0; 3] && *prism == [0.0; 4] && radial[4..] == [0.0; 2];
    bare && if *fisheye { *tangential == [0.0; 2] } else { radial[3] == 0.0 }
}

fn image_path(camera: &Camera) -> String {
    format!("images/{}", camera.image_name())
}

fn text(views: &[View], ply_file_path: Option<&str>) -> String {
    let lens = |view: &View| (view.0.intrinsics, view.1);
    let shared = views.first().map(lens).filter(|first| views.iter().all(|view| lens(view) == *first));
    let frames: Vec<Entries> = views
        .iter()
        .map(|(camera, distortion, image, mask)| {
            let axes = DMat3::from_quat(camera.pose.rotation);
            let p = camera.pose.position;
            let rows: Vec<[f64; 4]> = (0..3)
                .map(|r| [axes.x_axis[r], -axes.y_axis[r], -axes.z_axis[r], p[r]])
                .chain([[0.0, 0.0, 0.0, 1.0]])
                .collect();
            let mut frame = match shared {
                Some(_) => Entries::new(),
                None => lens_entries(&camera.intrinsics, distortion),
            };
            if let Some(mask) = mask {
                frame.insert("mask_path", json!(mask));
            }
            frame.insert("file_path", json!(image));
            frame.insert("transform_matrix", json!(rows));
            frame
        })
        .collect();
    let mut file = shared.map(|(k, distortion)| lens_entries(&k, &distortion)).unwrap_or_default();
    // Loaders look for the model at the top of the file, whatever the frames contain.
    let all_fisheye = !views.is_empty() && views.iter().all(|view| view.1.fisheye);
    file.insert("camera_model", json!(model(all_fisheye)));
    if let Some(points) = ply_file_path {
        file.insert("ply_file_path", json!(points));
    }
    file.insert("frames", json!(frames));
    format!("{:#}\n", json!(file))
}

fn model(fisheye: bool) -> &'static str {
    if fisheye { "OPENCV_FISHEYE" } else { "OPENCV" }
}

/// The entries that describe a lens.
fn lens_entries(k: &Intrinsics, distortion: &Distortion) -> Entries {
    let angle = |size: u32, focal: f64| 2.0 * (0.5 * f64::from(size) / focal).atan();
    let [k1, k2, k3, k4, ..] = distortion.radial;
    let [p1, p2] = distortion.tangential;
    let mut entries = Entries::from([
        ("camera_model", json!(model(distortion.fisheye))),
        ("fl_x", json!(k.focal[0])),
        ("fl_y", json!(k.focal[1])),
        ("cx", json!(k.principal[0])),
        ("cy", json!(k.principal[1])),
        ("w", json!(k.width)),
        ("h", json!(k.height)),
        ("camera_angle_x", json!(angle(k.width, k.focal[0]))),
        ("camera_angle_y", json!(angle(k.height, k.focal[1]))),
        ("k1", json!(k1)),
        ("k2", json!(k2)),
        ("p1", json!(p1)),
        ("p2", json!(p2)),
    ]);
    if [k3, k4] != [0.0; 2] {
        entries.extend([("k3", json!(k3)), ("k4", json!(k4))]);
    }
    entries
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::DVec3;

    use super::super::{parse, photos};
    use super::*;
    use crate::scene::camera::Pose;

    fn camera(name: &str, x: f64, width: u32) -> Camera {
        Camera {
            name: name.into(),
            pose: Pose::looking(DVec3::new(x, 0.5, -4.0), DVec3::new(-x, 0.1, 4.0), DVec3::Z),
            intrinsics: Intrinsics::from_fov(width, 480, 1.0),
        }
    }

    const PATH: &str = "no-such-folder/transforms.json";

    #[track_caller]
    fn assert_same(a: &Camera, b: &Camera) {
        assert_eq!((&a.name, a.intrinsics), (&b.name, b.intrinsics));
        assert!((a.pose.position - b.pose.position).length() < 1e-12);
        assert!(a.pose.rotation.dot(b.pose.rotation).abs() > 1.0 - 1e-12);
    }

    /// If this failed, what a trainer reads would not be what was planned, for shared and for separate lenses.
    #[test]
    fn cameras_survive_a_round_trip() {
        for second in [640, 320] {
            let written = vec![camera("0000.png", 0.3, 640), camera("0001.png", -2.0, second)];
            let text = write(&written, Some("points.ply"));
            assert!(text.contains("camera_angle_y") && text.contains("\"OPENCV\""), "{text}");
            let read = parse(Path::new(PATH), text.as_bytes(), &mut Vec::new()).unwrap();
            written.iter().zip(&read).for_each(|(a, b)| assert_same(a, b));
        }
    }

    /// If this failed, a subset would train with straight lenses, or a lens would be written that is another one.
    #[test]
    fn distortion_survives_or_is_reported() {
        let none = Distortion::default();
        let perspective = Distortion { radial: [0.1, -0.2, 0.03, 0.0, 0.0, 0.0], tangential: [1e-3, 2e-3], ..none };
        let fisheye = Distortion { fisheye: true, radial: [0.1, -0.2, 0.03, 0.01, 0.0, 0.0], ..none };
        let photo =
            |name: &str, distortion| Photo { camera: camera(name, 0.3, 640), distortion, image: None, mask: None };
        for lenses in [[perspective; 2], [fisheye; 2], [perspective, none], [fisheye, perspective]] {
            let written = [photo("a.png", lenses[0]), photo("b.png", lenses[1])];
            let (text, notes) = write_photos(&[&written[0], &written[1]], None);
            // Loaders that read only the top of the file take the fisheye for the other model.
            assert_eq!(notes.len(), usize::from(lenses[0].fisheye != lenses[1].fisheye), "{notes:?}");
            let read = photos(Path::new(PATH), text.as_bytes(), false, &mut Vec::new()).unwrap().photos;
            for (a, b) in written.iter().zip(&read) {
                assert_same(&a.camera, &b.camera);
                assert_eq!(a.distortion, b.distortion);
            }
        }
        let rational = photo("c.png", Distortion { rational: [0.1, 0.0, 0.0], ..none });
        let (text, notes) = write_photos(&[&rational, &photo("d.png", perspective)], Some("points.ply"));
        assert!(notes[0].contains("the lenses of 1 of 2 photos"), "{notes:?}");
        let read = photos(Path::new(PATH), text.as_bytes(), false, &mut Vec::new()).unwrap();
        assert!(read.photos[0].distortion.is_none() && !read.photos[1].distortion.is_none());
        assert_eq!(read.points.unwrap(), Path::new("no-such-folder/points.ply"));
    }
}
