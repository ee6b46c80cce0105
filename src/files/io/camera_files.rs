//! What a plan leaves for others: cameras as CSV, as pyramids to look at, and as the input of trainers.

use std::fmt::Write;

use glam::DVec3;

use super::colmap::write::Tracks;
use super::folder::OutputFolder;
use super::{colmap, ply, transforms};
use crate::error::Result;
use crate::scene::camera::Camera;
use crate::scene::colour::viridis;
use crate::scene::surface::Points;

/// Text of cameras.csv, one line per camera after a line of column names: name, position, world-from-camera quaternion
/// (w, x, y, z, OpenCV camera axes), unit viewing direction, focal lengths and principal point in pixels, image size in
/// pixels. World units are those of the surface.
pub fn cameras_csv(cameras: &[Camera]) -> String {
    let mut text = String::from("name,x,y,z,qw,qx,qy,qz,forward_x,forward_y,forward_z,fx,fy,cx,cy,w,h\n");
    for camera in cameras {
        let name = match camera.name.contains([',', '"', '\n', '\r']) {
            true => format!("\"{}\"", camera.name.replace('"', "\"\"")),
            false => camera.name.clone(),
        };
        text.push_str(&name);
        let (p, q, f) = (camera.pose.position, camera.pose.rotation, camera.pose.forward());
        let k = &camera.intrinsics;
        let numbers =
            [p.x, p.y, p.z, q.w, q.x, q.y, q.z, f.x, f.y, f.z, k.focal[0], k.focal[1], k.principal[0], k.principal[1]];
        for number in numbers {
            // Writing to a string cannot fail.
            let _ = write!(text, ",{number}");
        }
        let _ = writeln!(text, ",{},{}", k.width, k.height);
    }
    text
}

/// Bytes of frusta.ply: for each camera a pyramid from its centre to the corners of its image, `size` world units deep,
/// with a small triangle over the image's upper edge. `colours` go by camera, 8-bit sRGB; cameras without one are grey.
pub fn frusta_ply(cameras: &[Camera], colours: &[[u8; 3]], size: f64) -> Vec<u8> {
    let mut vertices = Vec::with_capacity(6 * cameras.len());
    let mut triangles = Vec::with_capacity(7 * cameras.len());
    for (i, camera) in cameras.iter().enumerate() {
        let colour = colours.get(i).copied().unwrap_or([128; 3]);
        let k = &camera.intrinsics;
        let at = |u: f64, v: f64| {
            let ray = DVec3::new((u - k.principal[0]) / k.focal[0], (v - k.principal[1]) / k.focal[1], 1.0);
            camera.pose.position + camera.pose.rotation * (size * ray)
        };
        let (w, h) = (f64::from(k.width), f64::from(k.height));
        let first = vertices.len() as u32;
        let corners = [camera.pose.position, at(0.0, 0.0), at(w, 0.0), at(w, h), at(0.0, h), at(0.5 * w, -0.25 * h)];
        vertices.extend(corners.map(|corner| (corner, colour)));
        // Apex 0, corners 1 to 4 clockwise in the image from its top left, tip of the upper mark 5.
        let faces = [[0, 2, 1], [0, 3, 2], [0, 4, 3], [0, 1, 4], [1, 2, 3], [1, 3, 4], [1, 5, 2]];
        triangles.extend(faces.map(|face: [u32; 3]| face.map(|v| first + v)));
    }
    ply::write::mesh(&vertices, &triangles)
}

/// Bytes of coverage.ply: points coloured by a value each, from dark blue at `range.0` to yellow at `range.1`, grey where
/// a value is missing or not finite; the values themselves are the float property `value`.
pub fn coverage_ply(positions: &[DVec3], values: &[f32], range: (f32, f32)) -> Vec<u8> {
    let span = range.1 - range.0;
    let fraction = |value: f32| if span > 0.0 { (value - range.0) / span } else { value - range.0 };
    let colours: Vec<[u8; 3]> = values.iter().map(|&value| viridis(fraction(value))).collect();
    ply::write::points(positions, &colours, Some(("value", values)))
}

/// Writes everything a trainer needs besides the photos, and what a user looks at first: `sparse/0/{cameras,images,
/// points3D}.bin`, `transforms.json`, `points.ply` and `cameras.csv`. Trainers start from the coloured `points`, and
/// several break without any. `tracks` lists which cameras see each point, as indices into `cameras`; empty where that
/// is not known.
///
/// # Errors
/// When the folder cannot be written.
pub fn capture(folder: &OutputFolder, cameras: &[Camera], points: &Points, tracks: Tracks) -> Result<()> {
    let Points { positions, colours, .. } = points;
    let lenses = colmap::write::pinholes(cameras);
    folder.write("sparse/0/cameras.bin", colmap::write::cameras(&lenses))?;
    folder.write("sparse/0/images.bin", colmap::write::images(cameras, &lenses, positions, tracks))?;
    folder.write("sparse/0/points3D.bin", colmap::write::points(positions, colours, cameras, tracks))?;
    folder.write("transforms.json", transforms::write(cameras, Some("points.ply")))?;
    folder.write("points.ply", ply::write::surface_points(points))?;
    folder.write("cameras.csv", cameras_csv(cameras))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::scene::camera::{Intrinsics, Pose};
    use crate::scene::surface::Surface;

    fn camera(name: &str) -> Camera {
        Camera {
            name: name.into(),
            pose: Pose::looking(DVec3::new(0.0, 0.0, -2.0), DVec3::Z, DVec3::Y),
            intrinsics: Intrinsics::from_fov(200, 100, std::f64::consts::FRAC_PI_2),
        }
    }

    /// If this failed, a robot's program would read numbers from the wrong columns.
    #[test]
    fn the_csv_has_a_number_under_every_name() {
        let text = cameras_csv(&[camera("a,\"b\""), camera("0001")]);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[1].starts_with("\"a,\"\"b\"\"\",0,0,-2,"), "{}", lines[1]);
        let columns: Vec<(&str, &str)> = lines[0].split(',').zip(lines[2].split(',')).collect();
        assert_eq!(lines[0].split(',').count(), lines[2].split(',').count());
        assert!(columns.contains(&("forward_z", "1")) && columns.contains(&("w", "200")), "{columns:?}");
    }

    /// If this failed, the pyramids would show another view than the cameras have.
    #[test]
    fn a_frustum_reaches_the_corners_of_its_image() {
        let bytes = frusta_ply(&[camera("a")], &[[9, 8, 7]], 0.5);
        let Surface::Mesh(mesh) = ply::parse(Path::new("frusta.ply"), &bytes, &mut Vec::new()).unwrap() else {
            panic!("not a mesh")
        };
        assert_eq!((mesh.positions.len(), mesh.triangles.len(), mesh.colours[0]), (6, 7, [9, 8, 7]));
        assert_eq!(mesh.positions[0], DVec3::new(0.0, 0.0, -2.0));
        // Seen along +z with y up, the image's left is at +x.
        assert!((mesh.positions[1] - DVec3::new(0.5, 0.25, -1.5)).length() < 1e-6, "{:?}", mesh.positions);
        assert!(mesh.positions[5].y > mesh.positions[1].y, "the mark stands above the image");
    }

    /// If this failed, colours and values of the coverage would not belong together.
    #[test]
    fn coverage_is_coloured_by_its_values() {
        let bytes = coverage_ply(&[DVec3::ZERO, DVec3::X, DVec3::Y], &[1.0, 3.0, f32::NAN], (1.0, 3.0));
        assert!(bytes.windows(20).any(|w| w == b"property float value"));
        let Surface::Points(points) = ply::parse(Path::new("coverage.ply"), &bytes, &mut Vec::new()).unwrap() else {
            panic!("not points")
        };
        assert_eq!(points.colours, [[68, 1, 84], [253, 231, 37], [128; 3]]);
    }

    /// If this failed, the exported folder would not be a capture that this program, or a trainer, can read.
    #[test]
    fn a_capture_reads_back_as_cameras_and_as_a_surface() {
        let parent = tempfile::tempdir().unwrap();
        let path = parent.path().join("out");
        let folder = OutputFolder::create(&path, false).unwrap();
        let cameras = vec![camera("0000.png"), camera("0001.png")];
        let points = Points {
            positions: vec![DVec3::ZERO, DVec3::new(0.1, 0.2, 0.3)],
            colours: vec![[1, 2, 3], [4, 5, 6]],
            ..Points::default()
        };
        capture(&folder, &cameras, &points, &[vec![0], vec![0, 1]]).unwrap();
        folder.commit().unwrap();
        assert_eq!(super::super::read_cameras(&path).unwrap().len(), 2);
        assert_eq!(super::super::read_cameras(&path.join("transforms.json")).unwrap()[1].name, "0001.png");
        let Surface::Points(read) = super::super::read_surface(&path).unwrap() else { panic!("not points") };
        assert_eq!((&read.positions, &read.colours), (&points.positions, &points.colours));
        assert_eq!(read.toward_cameras[0], DVec3::NEG_Z);
        assert!(super::super::read_surface(&path.join("points.ply")).is_ok());
    }
}
