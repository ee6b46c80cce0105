//! Cameras of Agisoft Metashape, as "Export Cameras" writes them (.xml): sensors with calibrations, cameras with poses from camera to
//! chunk in OpenCV's axes, and components or a chunk that a similarity brings to the world.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use roxmltree::{Document, Node};

use super::lookup::Lookup;
use super::{Found, files};
use crate::error::{Error, Result};
use crate::files::io::left_out::LeftOut;
use crate::files::io::matrix::{self, Axes};
use crate::files::io::{checks, read_file};
use crate::files::photos::{Convention, Photo};
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::lens::Distortion;
use crate::scene::similarity::Similarity;

/// A photo of the file, before its image is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// Label, pose in the world and pinhole.
    pub camera: Camera,
    /// What the pinhole does not explain.
    pub distortion: Distortion,
}

/// Cameras of the file that have a pose, and notes on what was left out.
///
/// # Errors
/// Where this is no such file, or holds a camera that cannot be.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Vec<Exported>> {
    let refuse = |what: String| Error::input(path, what);
    let text = std::str::from_utf8(bytes).map_err(|_| refuse("it is no text; export the cameras again".into()))?;
    let document = Document::parse(text).map_err(|e| refuse(format!("{e}; export the cameras again")))?;
    let all = |name: &'static str| document.descendants().filter(move |node| node.has_tag_name(name));
    let mut sensors: HashMap<&str, Sensor> = HashMap::new();
    let mut bad_sensors = LeftOut::default();
    for node in all("sensor") {
        match sensor(&node) {
            Ok(sensor) => _ = sensors.insert(node.attribute("id").unwrap_or_default(), sensor),
            Err(what) => bad_sensors.add(format!("sensor {:?} {what}", node.attribute("label").unwrap_or_default())),
        }
    }
    let chunk = all("chunk").next().and_then(|chunk| child(&chunk, "transform"));
    let chunk = chunk.map(|node| similarity(&node)).transpose().map_err(refuse)?.unwrap_or(Similarity::IDENTITY);
    let mut components = HashMap::new();
    for component in all("component") {
        if let (Some(id), Some(transform)) = (component.attribute("id"), child(&component, "transform")) {
            components.insert(id, similarity(&transform).map_err(refuse)?);
        }
    }
    let nodes: Vec<Node> = all("camera").filter(|node| node.attribute("sensor_id").is_some()).collect();
    let masters: HashMap<&str, Node> = nodes.iter().filter_map(|node| Some((node.attribute("id")?, *node))).collect();
    let mut found = Vec::new();
    let (mut unposed, mut bad_cameras) = (0, LeftOut::default());
    for node in nodes {
        let label = node.attribute("label").unwrap_or_default();
        let sensor = node.attribute("sensor_id").and_then(|id| sensors.get(id));
        // A camera of a rig that is not the rig's first has that one's pose, moved and turned as its sensor is.
        let master = node.attribute("master_id").and_then(|id| masters.get(id));
        let (own, of_master) = (child(&node, "transform"), master.and_then(|master| child(master, "transform")));
        let (Some(transform), Some(sensor)) = (own.or(of_master), sensor) else {
            unposed += 1;
            continue;
        };
        let placed = pose(&transform).map_err(|what| format!("has a transform that {what}")).and_then(|pose| {
            let pose = if own.is_none() { after(&pose, &sensor.in_rig) } else { pose };
            // Newer versions move components to the world, older ones the chunk.
            let component = |node: &Node| node.attribute("component_id").and_then(|id| components.get(id));
            let to_world = component(&node).or(master.and_then(component)).unwrap_or(&chunk);
            let camera = Camera { name: label.into(), pose: to_world.pose(&pose), intrinsics: sensor.intrinsics };
            checks::camera(&camera).map(|()| camera)
        });
        match placed {
            Ok(camera) => found.push(Exported { camera, distortion: sensor.distortion }),
            Err(what) => bad_cameras.add(format!("camera {label:?} {what}")),
        }
    }
    if found.is_empty() {
        let why = bad_cameras.first().or(bad_sensors.first()).map(|why| format!(" ({why})")).unwrap_or_default();
        return Err(refuse(format!(
            "it holds no cameras with poses and calibrations{why}; align the photos, then export the cameras"
        )));
    }
    if unposed > 0 {
        notes.push(format!("{unposed} cameras have no pose or no calibration that is known, and are left out"));
    }
    bad_sensors.note("sensors", notes);
    bad_cameras.note("cameras", notes);
    Ok(found)
}

/// A camera-to-chunk pose.
fn pose(transform: &Node<'_, '_>) -> Result<Pose, String> {
    let numbers = numbers::<16>(transform).ok_or("is not 16 numbers")?;
    let rows = [0, 4, 8].map(|i| [numbers[i], numbers[i + 1], numbers[i + 2], numbers[i + 3]]);
    matrix::pose(&rows, Axes::OpenCv)
}

/// The pose of what is at `inner` in the frame of what is at `outer`.
fn after(outer: &Pose, inner: &Pose) -> Pose {
    Pose {
        position: outer.position + outer.rotation * inner.position,
        rotation: (outer.rotation * inner.rotation).normalize(),
    }
}

/// Reads a file of cameras, whose images lie beside it or in `images/`.
pub(super) fn read(path: &Path) -> Result<Found> {
    let mut notes = Vec::new();
    let exported = parse(path, &read_file(path)?, &mut notes)?;
    let root = path.parent().unwrap_or(Path::new(""));
    let folders: Vec<PathBuf> = files::image_folders(root).into_iter().chain([root.to_owned()]).collect();
    let lookup = Lookup::default();
    let photo = |Exported { mut camera, distortion }: Exported| {
        // Labels are the names of files, mostly without their extension.
        let image = lookup.image(&folders, &camera.name);
        if let Some(name) = image.as_deref().and_then(Path::file_name) {
            camera.name = name.to_string_lossy().into_owned();
        }
        let mask = files::mask(root, &camera.name);
        Photo { camera, distortion, image, mask }
    };
    let mut photos: Vec<Photo> = exported.into_iter().map(photo).collect();
    photos.sort_by(|a, b| a.camera.name.cmp(&b.camera.name));
    let mut left_out = LeftOut::default();
    checks::usable_photos(path, &mut photos, &mut left_out)?;
    left_out.note("photos", &mut notes);
    Ok(Found { photos, convention: Convention::Metashape, notes, ..Found::default() })
}

fn child<'d>(node: &Node<'d, 'd>, name: &str) -> Option<Node<'d, 'd>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// The numbers in a node's text, so many.
fn numbers<const N: usize>(node: &Node<'_, '_>) -> Option<[f64; N]> {
    let read: Option<Vec<f64>> = node.text()?.split_whitespace().map(|number| number.parse().ok()).collect();
    read?.try_into().ok()
}

/// A sensor: its lens, and where it is in its rig.
struct Sensor {
    intrinsics: Intrinsics,
    distortion: Distortion,
    /// To the frame of the rig's first sensor.
    in_rig: Pose,
}

/// A sensor of the file. Formulas: Metashape's manual, "Camera models"; its P1 and P2 are OpenCV's p2 and p1. The place of a sensor in its
/// rig is that of its centre, and its rotation that to the first sensor's axes (`Sensor.location` and `Sensor.rotation` of the manual).
///
/// # Errors
/// Where it is of another kind, has no calibration, or one that is none, as a continuation of its name.
fn sensor(node: &Node<'_, '_>) -> Result<Sensor, String> {
    let fisheye = match node.attribute("type") {
        Some("frame") => false,
        Some("fisheye") => true,
        kind => return Err(format!("is of the kind {:?}, and neither frame nor fisheye", kind.unwrap_or_default())),
    };
    let calibrations = || node.children().filter(|node| node.has_tag_name("calibration"));
    let adjusted = calibrations().find(|node| node.attribute("class") == Some("adjusted"));
    let Some(calibration) = adjusted.or_else(|| calibrations().next()) else { return Err("has no calibration".into()) };
    let resolution = child(&calibration, "resolution").or_else(|| child(node, "resolution"));
    let size = |name: &str| -> Option<u32> { resolution?.attribute(name)?.parse().ok() };
    let (Some(width), Some(height)) = (size("width"), size("height")) else { return Err("has no resolution".into()) };
    let value = |name: &str| match child(&calibration, name) {
        Some(node) => numbers::<1>(&node).map(|[value]| value).ok_or_else(|| format!("has no number as {name}")),
        None => Ok(0.0),
    };
    let focal = value("f")?;
    let intrinsics = Intrinsics {
        width,
        height,
        focal: [focal + value("b1")?, focal],
        principal: [0.5 * f64::from(width) + value("cx")?, 0.5 * f64::from(height) + value("cy")?],
    };
    let distortion = Distortion {
        fisheye,
        radial: [value("k1")?, value("k2")?, value("k3")?, value("k4")?, 0.0, 0.0],
        tangential: [value("p2")?, value("p1")?],
        ..Distortion::default()
    };
    let r = match child(node, "rotation") {
        Some(node) => numbers::<9>(&node).ok_or("has no rotation of 9 numbers")?,
        None => [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
    };
    let centre = match child(node, "location").or_else(|| child(node, "translation")) {
        Some(node) => numbers::<3>(&node).ok_or("has no location of 3 numbers")?,
        None => [0.0; 3],
    };
    let rows = [0, 1, 2].map(|i| [r[3 * i], r[3 * i + 1], r[3 * i + 2], centre[i]]);
    let in_rig = matrix::pose(&rows, Axes::OpenCv).map_err(|what| format!("has a rotation that {what}"))?;
    Ok(Sensor { intrinsics, distortion, in_rig })
}

/// The similarity of a component or a chunk.
fn similarity(node: &Node<'_, '_>) -> Result<Similarity, String> {
    let wrong = |what: &str| format!("the transform of a component or chunk {what}; export the cameras again");
    let part = |name: &str| child(node, name);
    let translation = match part("translation") {
        Some(node) => DVec3::from_array(numbers::<3>(&node).ok_or_else(|| wrong("has no translation of 3 numbers"))?),
        None => DVec3::ZERO,
    };
    let scale = match part("scale") {
        Some(node) => numbers::<1>(&node).map(|[scale]| scale).ok_or_else(|| wrong("has no number as scale"))?,
        None => 1.0,
    };
    let r = match part("rotation") {
        Some(node) => numbers::<9>(&node).ok_or_else(|| wrong("has no rotation of 9 numbers"))?,
        None => [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
    };
    let rows = [0, 3, 6].map(|i| [r[i], r[i + 1], r[i + 2], 0.0]);
    let rotation = matrix::pose(&rows, Axes::OpenCv).map_err(|what| wrong(&what))?.rotation;
    if !(scale > 0.0 && scale.is_finite() && translation.is_finite()) {
        return Err(wrong("has no scale above zero"));
    }
    Ok(Similarity { rotation, scale, translation })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera at (1, 2, 3) of the chunk that looks along +z with its picture's up along -y, in a chunk or component that is turned by a
    /// quarter about z, twice as large and moved.
    fn document(around: &str, id: &str) -> String {
        let placed =
            "<rotation locked=\"true\">0 -1 0 1 0 0 0 0 1</rotation><translation>10 0 0</translation><scale>2</scale>";
        let [chunk, component] = match around {
            "chunk" => [format!("<transform>{placed}</transform>"), String::new()],
            _ => [
                String::new(),
                format!("<components><component id=\"0\"><transform>{placed}</transform></component></components>"),
            ],
        };
        format!(
            r#"<?xml version="1.0" encoding="UTF-8"?>
<document version="2.0.0"><chunk label="Chunk 1"><sensors next_id="1">
  <sensor id="0" label="X-T3" type="frame"><resolution width="80" height="60"/>
    <calibration type="frame" class="initial"><f>1</f></calibration>
    <calibration type="frame" class="adjusted"><resolution width="80" height="60"/><f>70</f><cx>1.5</cx><cy>-2</cy>
      <k1>-0.1</k1><k2>0.02</k2><k3>0.003</k3><p1>0.004</p1><p2>-0.005</p2><b1>0.5</b1></calibration></sensor>
  <sensor id="1" label="sphere" type="spherical"/></sensors>{component}
<cameras next_id="2"><camera id="0" sensor_id="0" {id} label="DSC_1"><transform>1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1</transform></camera>
<camera id="1" sensor_id="0" label="DSC_2"/><camera id="2" sensor_id="1" label="DSC_3"><transform>1</transform></camera></cameras>
{chunk}</chunk></document>"#
        )
    }

    /// If this failed, captures of Metashape would be read with wrong poses, with lenses of the initial guess, or with the tangential terms
    /// swapped, as they are beside OpenCV's.
    #[test]
    fn cameras_are_read_in_the_world() {
        for (around, id) in [("chunk", ""), ("component", "component_id=\"0\"")] {
            let mut notes = Vec::new();
            let found = parse(Path::new("cameras.xml"), document(around, id).as_bytes(), &mut notes).unwrap();
            assert_eq!((found.len(), notes.len()), (1, 2), "{notes:?}");
            let Exported { camera, distortion } = &found[0];
            // The quarter turn brings x to y and y to -x.
            assert!(camera.pose.position.distance(DVec3::new(6.0, 2.0, 6.0)) < 1e-12, "{camera:?}");
            assert!(camera.pose.forward().distance(DVec3::Z) < 1e-12 && camera.pose.up().distance(DVec3::X) < 1e-12);
            assert_eq!((camera.intrinsics.focal, camera.intrinsics.principal), ([70.5, 70.0], [41.5, 28.0]));
            assert_eq!(
                (distortion.radial[..3].to_vec(), distortion.tangential),
                (vec![-0.1, 0.02, 0.003], [-0.005, 0.004])
            );
        }
    }

    /// If this failed, all cameras of a rig but its first would be lost, or stand where that one does.
    #[test]
    fn cameras_of_a_rig_have_their_sensor_s_place() {
        let text = document("component", "component_id=\"0\"");
        // The second sensor is 0.5 to the right of the first and turned by a quarter about z.
        let sensor = "<rotation locked=\"false\">0 -1 0 1 0 0 0 0 1</rotation><location>0.5 0 0</location></sensor>";
        let second = text.find("<sensor id=\"0\"").map(|from| {
            let whole = &text[from..from + text[from..].find("</sensor>").unwrap()];
            format!("{}{sensor}", whole.replacen("id=\"0\"", "id=\"9\" master_id=\"0\"", 1))
        });
        let camera = "<camera id=\"90\" master_id=\"0\" sensor_id=\"9\" label=\"second\"/></cameras>";
        let text =
            text.replacen("</sensors>", &format!("{}</sensors>", second.unwrap()), 1).replacen("</cameras>", camera, 1);
        let found = parse(Path::new("cameras.xml"), text.as_bytes(), &mut Vec::new()).unwrap();
        assert_eq!(found.len(), 2, "{found:?}");
        let [first, second] = [0, 1].map(|i| found[i].camera.pose);
        // The component turns x to y and is twice as large.
        assert!(second.position.distance(first.position + DVec3::Y) < 1e-12, "{first:?} {second:?}");
        assert!(second.forward().distance(DVec3::Z) < 1e-12 && second.up().distance(DVec3::Y) < 1e-12, "{second:?}");
        assert_eq!(found[1].camera.intrinsics, found[0].camera.intrinsics);
    }

    /// If this failed, images beside the file, or in `images`, would not be found by their labels without extension.
    #[test]
    fn images_are_found_by_their_labels() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cameras.xml");
        std::fs::write(&file, document("chunk", "")).unwrap();
        for place in ["", "images"] {
            std::fs::create_dir_all(folder.path().join(place)).unwrap();
            let image = folder.path().join(place).join("DSC_1.JPG");
            std::fs::write(&image, "").unwrap();
            let found = read(&file).unwrap();
            assert_eq!((found.photos[0].image.as_ref(), &found.photos[0].camera.name[..]), (Some(&image), "DSC_1.JPG"));
        }
    }

    /// If this failed, a damaged export would end the program, or give cameras that cannot be.
    #[test]
    fn damaged_exports_are_refused() {
        let good = document("chunk", "");
        for (from, to) in [
            ("</document>", ""),
            ("1 0 0 1 0 1 0 2 0 0 1 3", "1 1 0 1 0 1 0 2 0 0 1 3"),
            ("1 0 0 1 0 1 0 2 0 0 1 3", "1 0 0"),
            ("<f>70</f>", "<f>0</f>"),
            ("<f>70</f>", "<f>wide</f>"),
            ("<scale>2</scale>", "<scale>0</scale>"),
            ("width=\"80\" height=\"60\"/><f>", "width=\"-1\" height=\"60\"/><f>"),
            ("sensor_id=\"0\"", "sensor_id=\"7\""),
        ] {
            let bad = good.replace(from, to);
            assert!(bad != good, "{from} is not in the file");
            let read = parse(Path::new("cameras.xml"), bad.as_bytes(), &mut Vec::new());
            assert!(read.is_err(), "{from} -> {to}: {read:?}");
        }
    }
}
