//! The image and mask files of photos: where they lie, and whether their size fits the camera.

use std::path::{Component, Path, PathBuf};

use crate::error::{Error, Result};
use crate::files::photos::{Header, Photo};
use crate::scene::camera::Intrinsics;

/// Extensions of images that can be decoded.
const EXTENSIONS: [&str; 6] = ["jpg", "jpeg", "png", "JPG", "JPEG", "PNG"];

/// Folders that captures keep their masks in.
const MASKS: [&str; 2] = ["masks", "mask"];

/// The folders under `root` that hold images: `images`, then shrunk copies (`images_2` and the like), largest first.
pub(crate) fn image_folders(root: &Path) -> Vec<PathBuf> {
    let shrink = |name: &str| name.strip_prefix("images_").and_then(|factor| factor.parse::<u32>().ok());
    let mut copies: Vec<(u32, PathBuf)> = std::fs::read_dir(root)
        .into_iter()
        .flatten()
        .flatten()
        .filter_map(|entry| Some((shrink(entry.file_name().to_str()?)?, entry.path())))
        .collect();
    copies.sort();
    let folders = std::iter::once(root.join("images")).chain(copies.into_iter().map(|(_, path)| path));
    folders.filter(|folder| folder.is_dir()).collect()
}

/// The path of `name` in `folder`; none where it leads out of it. What it leads to need not be there.
pub(crate) fn within(folder: &Path, name: &str) -> Option<PathBuf> {
    let path = folder.join(name);
    if Path::new(name).is_absolute() {
        let absolute = |path: &Path| std::path::absolute(path).ok();
        let inside = absolute(&path)?.starts_with(absolute(folder)?);
        return (inside && !path.components().any(|part| part == Component::ParentDir)).then_some(path);
    }
    let mut depth = 0;
    for part in Path::new(name).components() {
        depth += match part {
            Component::Normal(_) => 1,
            Component::ParentDir => -1,
            _ => 0,
        };
        if depth < 0 {
            return None;
        }
    }
    Some(path)
}

/// The image `name` in the first of `folders` that has it, with another extension where there is none with its own:
/// shrunk copies are often stored in another format.
pub(crate) fn image(folders: &[PathBuf], name: &str) -> Option<PathBuf> {
    folders.iter().find_map(|folder| {
        let path = within(folder, name)?;
        let others = EXTENSIONS.iter().map(|extension| path.with_extension(extension));
        std::iter::once(path.clone()).chain(others).find(|path| path.is_file())
    })
}

/// The mask of the image `name`: `masks/NAME.png` as COLMAP has it, the name with `.png` in place of its extension, or either with
/// the extension of another image format; or the same in the folder `mask`.
pub(crate) fn mask(root: &Path, name: &str) -> Option<PathBuf> {
    // PNG first: masks that were saved as JPEG too have lost something.
    let extensions = || ["png"].into_iter().chain(EXTENSIONS.into_iter().filter(|extension| *extension != "png"));
    let files = MASKS.iter().filter_map(|folder| within(&root.join(folder), name)).flat_map(|path| {
        extensions().flat_map(move |extension| {
            [PathBuf::from(format!("{}.{extension}", path.display())), path.with_extension(extension)]
        })
    });
    files.into_iter().find(|path| path.is_file())
}

/// Image files under `folder`, by their path from there with `/` between folders, in the order of names; folders in it too.
pub(crate) fn images_in(folder: &Path) -> Vec<String> {
    let mut names = Vec::new();
    let mut open = vec![String::new()];
    while let Some(below) = open.pop() {
        for entry in std::fs::read_dir(folder.join(&below)).into_iter().flatten().flatten() {
            let name = format!("{below}{}", entry.file_name().to_string_lossy());
            let has = |extension: &str| EXTENSIONS.contains(&extension);
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => open.push(format!("{name}/")),
                _ if name.rsplit_once('.').is_some_and(|(_, extension)| has(extension)) => names.push(name),
                _ => {}
            }
        }
    }
    names.sort();
    names
}

/// Width and height of a stored image; none where it cannot be read.
pub(crate) fn size(path: &Path) -> Option<(u32, u32)> {
    let header = Header::read(path).ok()?;
    Some((header.width, header.height))
}

/// The message where an image is of another shape than its camera.
pub(crate) fn disagreement(camera: &Intrinsics, width: u32, height: u32) -> String {
    let turned = camera.resized(height, width).is_some();
    let remedy = match turned {
        true => "it lies on its side: turn the file itself, for turns in EXIF data are not applied",
        false => "give the image that the camera was calibrated for, or a copy of it that was scaled as a whole",
    };
    format!("the image is {width} x {height} pixels and its camera {} x {}; {remedy}", camera.width, camera.height)
}

/// What the check of the files of photos found.
#[derive(Default)]
pub(crate) struct Settled {
    /// What is missing or unreadable: files, or names of images that were not found.
    pub missing: Vec<String>,
    /// Photos whose intrinsics were rescaled to the stored image.
    pub rescaled: usize,
}

/// Reads the header of every image and mask. Images that cannot be read are taken from their photos; intrinsics are
/// rescaled to the stored images.
///
/// # Errors
/// Where an image or a mask is of another shape than the camera.
pub(crate) fn settle(photos: &mut [Photo]) -> Result<Settled> {
    let mut settled = Settled::default();
    for photo in photos {
        let Some(image) = &photo.image else {
            settled.missing.push(photo.camera.name.clone());
            continue;
        };
        let k = &mut photo.camera.intrinsics;
        match Header::read(image) {
            Err(e) => {
                settled.missing.push(format!("{} ({e})", image.display()));
                photo.image = None;
            }
            Ok(Header { width, height, .. }) => {
                let resized = k.resized(width, height);
                let resized = resized.ok_or_else(|| Error::input(image, disagreement(k, width, height)))?;
                settled.rescaled += usize::from((k.width, k.height) != (width, height));
                *k = resized;
            }
        }
        let Some(mask) = &photo.mask else { continue };
        match Header::read(mask) {
            Err(e) => {
                settled.missing.push(format!("{} ({e})", mask.display()));
                photo.mask = None;
            }
            Ok(Header { width, height, .. }) if k.resized(width, height).is_none() => {
                let what = format!(
                    "the mask is {width} x {height} pixels and its image {} x {}; make the masks again for these images",
                    k.width, k.height
                );
                return Err(Error::input(mask, what));
            }
            Ok(_) => {}
        }
    }
    Ok(settled)
}
