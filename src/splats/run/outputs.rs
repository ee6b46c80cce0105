//! The files of a training run: where they go, and what must not be lost to them.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::evaluate::Pair;
use super::record::TrainRecord;
use crate::engine::parallel::try_each;
use crate::files::io::folder::{replace_file, replace_unforced};
use crate::files::io::picture;
use crate::files::io::splats::SplatFormat;
use crate::files::io::{ply, transforms};
use crate::files::photos::Photo;
use crate::scene::surface::Points;
use crate::{Error, Result};

/// What a stopped run is resumed from.
pub(crate) const CHECKPOINT: &str = "checkpoint.bin";
/// The trained Gaussians in the capture's frame, in the usual layout.
pub(crate) const MODEL: &str = "point_cloud.ply";
/// The same in another format.
pub(crate) fn model_in(format: SplatFormat) -> String {
    format!("point_cloud.{}", format.extension())
}

/// Cameras of the photos with their poses corrected, where they were; the seed cloud is beside it. In a folder of their own, so that no
/// capture in the same folder is replaced.
pub(crate) const REFINED: &str = "refined/transforms.json";
/// See [`REFINED`].
const REFINED_POINTS: &str = "refined/points.ply";
/// The record of the run.
pub(crate) const RECORD: &str = "train.json";
/// The HTML report.
pub(crate) const REPORT: &str = "report.html";
/// Folders of the test views: as they are rendered, and the photos as they are compared with.
pub(crate) const PICTURES: [&str; 2] = ["test", "reference"];

/// File names of the pictures of photos with these names, whatever their order: without the folders that all have in common,
/// and where two would be the same, with the photos' places in the order of names.
pub(crate) fn picture_names(names: &[String]) -> Vec<PathBuf> {
    let paths: Vec<PathBuf> = names.iter().map(|name| picture::stem(name).unwrap_or_default().into()).collect();
    let folder = |path: &PathBuf| path.parent().map(Path::to_path_buf).unwrap_or_default();
    let shared = paths
        .iter()
        .map(folder)
        .reduce(|a, b| a.components().zip(b.components()).take_while(|(a, b)| a == b).map(|(a, _)| a).collect());
    let shared = shared.unwrap_or_default();
    let short: Vec<&Path> = paths.iter().map(|path| path.strip_prefix(&shared).unwrap_or(path)).collect();
    let named = |path: &Path, before: String| {
        path.with_file_name(format!("{before}{}.png", path.file_name().unwrap_or_default().to_string_lossy()))
    };
    let plain: Vec<PathBuf> = short.iter().map(|path| named(path, String::new())).collect();
    // Some file systems take upper and lower case for the same.
    let different: HashSet<String> = plain.iter().map(|path| path.to_string_lossy().to_lowercase()).collect();
    if different.len() == plain.len() {
        return plain;
    }
    let place = |name: &String| names.iter().filter(|other| *other < name).count();
    short.iter().zip(names).map(|(path, name)| named(path, format!("{}_", place(name)))).collect()
}

/// Rejects a run that would replace what it reads: whose folder is the capture's own, or one of whose files is a photo or mask.
///
/// # Errors
/// In a line that names the file.
pub fn check(folder: &Path, capture: &Path, photos: &[&Photo], names: &[PathBuf]) -> Result<()> {
    // What is not there cannot be lost.
    let real = |path: &Path| path.canonicalize().ok();
    let capture = if capture.is_dir() { capture } else { capture.parent().unwrap_or(capture) };
    let capture = if capture.as_os_str().is_empty() { Path::new(".") } else { capture };
    if real(folder).is_some_and(|folder| real(capture) == Some(folder)) {
        return Err(Error::input(folder, "this is the folder of the capture; name another to write to"));
    }
    let read = photos.iter().flat_map(|photo| [&photo.image, &photo.mask]).flatten();
    let read: HashSet<PathBuf> = read.filter_map(|path| real(path)).collect();
    let own = [CHECKPOINT, MODEL, RECORD, REPORT].map(|name| folder.join(name));
    let pictures = PICTURES.iter().flat_map(|of| names.iter().map(move |name| folder.join(of).join(name)));
    match own.into_iter().chain(pictures).find(|path| real(path).is_some_and(|path| read.contains(&path))) {
        Some(path) => Err(Error::input(path, "this photo would be replaced; name another folder to write to")),
        None => Ok(()),
    }
}

/// Removes what an earlier run left in the folder, so that nothing of it is mistaken for this one's.
///
/// # Errors
/// When the system refuses.
pub fn clear(folder: &Path) -> Result<()> {
    let text = std::fs::read_to_string(folder.join(RECORD)).unwrap_or_default();
    let earlier = serde_json::from_str(&text).map_or(Vec::new(), |record: TrainRecord| record.test_views);
    let names = picture_names(&earlier.into_iter().map(|view| view.name).collect::<Vec<_>>());
    let pictures = PICTURES.iter().flat_map(|of| names.iter().map(move |name| folder.join(of).join(name)));
    let models = SplatFormat::ALL.map(model_in);
    let own = [CHECKPOINT, REFINED, REFINED_POINTS]
        .into_iter()
        .chain(models.iter().map(String::as_str))
        .map(|name| folder.join(name));
    for path in own.chain(pictures).filter(|path| path.is_file()) {
        std::fs::remove_file(&path).map_err(|source| Error::io(&path, source))?;
    }
    Ok(())
}

/// Forces pictures of test views that have been written to the disk. Forcing each as it is written would take longer than
/// everything else.
///
/// # Errors
/// When the system refuses.
pub(crate) fn force_pairs(folder: &Path, names: &[PathBuf]) -> Result<()> {
    let files: Vec<PathBuf> =
        PICTURES.iter().flat_map(|of| names.iter().map(move |name| folder.join(of).join(name))).collect();
    let force = |file: &PathBuf| std::fs::File::open(file).and_then(|opened| opened.sync_all());
    try_each(&files, |file| force(file).map_err(|source| Error::io(file, source)))
}

/// Writes a test view, rendered and as it should be; [`force_pairs`] comes after the last.
///
/// # Errors
/// When the system refuses.
pub(crate) fn write_pair(folder: &Path, name: &Path, pair: &Pair) -> Result<()> {
    for (of, pixels) in PICTURES.iter().zip([&pair.rendered, &pair.reference]) {
        let file = folder.join(of).join(name);
        if let Some(parent) = file.parent() {
            std::fs::create_dir_all(parent).map_err(|source| Error::io(parent, source))?;
        }
        replace_unforced(&file, &picture::rgb(pair.width, pixels)?)?;
    }
    Ok(())
}

/// Writes the photos' corrected cameras, which name the images where they lie, and the capture's points; what is to be said of these.
///
/// # Errors
/// When the system refuses.
pub(crate) fn write_refined(folder: &Path, photos: &[Photo], points: &Points) -> Result<Vec<String>> {
    let file = folder.join(REFINED);
    let beside = file.parent().unwrap_or(folder);
    std::fs::create_dir_all(beside).map_err(|source| Error::io(beside, source))?;
    let paths = |photo: &Photo| {
        let image = photo.image.as_deref().map(|image| from_folder(beside, image));
        (image.unwrap_or_default(), photo.mask.as_deref().map(|mask| from_folder(beside, mask)))
    };
    let cloud = (!points.positions.is_empty()).then(|| ply::write::points(&points.positions, &points.colours, None));
    let name = cloud.as_ref().map(|_| "points.ply");
    let (text, notes) = transforms::write_photos_at(&photos.iter().collect::<Vec<_>>(), name, paths);
    if let Some(cloud) = cloud {
        replace_file(&folder.join(REFINED_POINTS), |file| file.write_all(&cloud))?;
    }
    replace_file(&file, |file| file.write_all(text.as_bytes()))?;
    Ok(notes)
}

/// The path of a file as it is from a folder, with `/`; the whole path where they have nothing in common, and as it is where one is not there.
/// A link keeps its own name.
fn from_folder(folder: &Path, file: &Path) -> String {
    let whole = file.parent().and_then(|parent| Some(parent.canonicalize().ok()?.join(file.file_name()?)));
    let (Ok(folder), Some(whole)) = (folder.canonicalize(), whole) else {
        return file.display().to_string();
    };
    let shared = folder.components().zip(whole.components()).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return whole.display().to_string();
    }
    let up = folder.components().skip(shared).map(|_| "..".into());
    let down = whole.components().skip(shared).map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<String>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, training anew would mistake files of an earlier run for its own, or remove a user's capture from the folder.
    #[test]
    fn what_an_earlier_run_left_goes_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("refined")).unwrap();
        let kept = ["transforms.json", "points.ply", "refined/notes.txt"];
        for name in [&[CHECKPOINT, MODEL, REFINED, REFINED_POINTS][..], &kept].concat() {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        clear(folder.path()).unwrap();
        for name in [CHECKPOINT, MODEL, REFINED, REFINED_POINTS] {
            assert!(!folder.path().join(name).exists(), "{name} stayed");
        }
        assert!(kept.iter().all(|name| folder.path().join(name).exists()), "what is not of a run is gone");
    }

    /// If this failed, other trainers would not find the photos of corrected cameras.
    #[test]
    fn photos_are_named_as_they_lie_from_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let place = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(place("out/refined")).unwrap();
        std::fs::create_dir_all(place("capture/images/left")).unwrap();
        std::fs::write(place("capture/images/left/a b.jpg"), "").unwrap();
        let from = |file: &str| from_folder(&place("out/refined"), &place(file));
        assert_eq!(from("capture/images/left/a b.jpg"), "../../capture/images/left/a b.jpg");
        assert_eq!(from("out/refined/b.jpg"), "b.jpg");
        let gone = place("gone/c.jpg");
        assert_eq!(from("gone/c.jpg"), gone.display().to_string());
    }

    fn names(given: &[&str]) -> Vec<String> {
        let names: Vec<String> = given.iter().map(|name| (*name).to_owned()).collect();
        picture_names(&names).iter().map(|path| path.to_string_lossy().into_owned()).collect()
    }

    /// If this failed, pictures of one test view would replace those of another, or be hidden in folders with meaningless names.
    #[test]
    fn every_test_view_has_a_file_of_its_own() {
        assert_eq!(names(&["test/r_0.png", "test/r_1.jpg"]), ["r_0.png", "r_1.png"]);
        assert_eq!(names(&["a/0/x.png", "a/1/x.png"]), ["0/x.png", "1/x.png"]);
        assert_eq!(names(&["/home/me/x.jpg", "../y.jpg"]), ["home/me/x.png", "y.png"]);
        assert_eq!(names(&["0.PNG", "0.png", "1.jpg"]), ["0_0.png", "1_0.png", "2_1.png"]);
        assert_eq!(names(&["1.jpg", "0.png", "0.PNG"]), ["2_1.png", "1_0.png", "0_0.png"]);
        assert_eq!(names(&["only/one.png"]), ["one.png"]);
        assert!(names(&[]).is_empty());
    }

    /// Test photos were once overwritten by the pictures of a run that wrote beside them.
    #[test]
    fn what_is_read_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path();
        std::fs::create_dir_all(place.join("data/test")).unwrap();
        std::fs::create_dir_all(place.join("data/train")).unwrap();
        let image = place.join("data/test/r_0.png");
        image::RgbImage::new(2, 2).save(&image).unwrap();
        let camera = crate::scene::camera::Camera {
            name: "r_0.png".into(),
            pose: crate::scene::camera::Pose::looking(glam::DVec3::X, glam::DVec3::NEG_X, glam::DVec3::Z),
            intrinsics: crate::scene::camera::Intrinsics::from_fov(2, 2, 1.0),
        };
        let photo = Photo { camera, distortion: Default::default(), image: Some(image.clone()), mask: None };
        let names = [PathBuf::from("r_0.png")];
        let capture = place.join("data/train");
        let refusal = check(&place.join("data"), &capture, &[&photo], &names).unwrap_err().to_string();
        assert!(refusal.contains("r_0.png: this photo would be replaced"), "{refusal}");
        check(&place.join("out"), &capture, &[&photo], &names).unwrap();
        let refusal =
            check(&place.join("data"), &place.join("data/transforms.json"), &[], &[]).unwrap_err().to_string();
        assert!(refusal.contains("the folder of the capture"), "{refusal}");
    }
}
