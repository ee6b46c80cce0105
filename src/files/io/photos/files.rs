//! The image and mask files of photos: where they lie, and whether their size fits the camera.

use std::path::{Component, Path, PathBuf};

use crate::files::photos::orientation::quarter_turn;
use crate::files::photos::{Header, Photo};
use crate::scene::camera::Intrinsics;

/// Extensions of images that can be decoded, in the order in which they are looked for.
pub(super) const EXTENSIONS: [&str; 8] = ["jpg", "jpeg", "png", "webp", "JPG", "JPEG", "PNG", "WEBP"];

/// Extensions of images that cannot be decoded, so that they are not said to be missing.
const OTHERS: [&str; 8] = ["avif", "heic", "heif", "jxl", "tif", "tiff", "bmp", "gif"];

/// Whether a file is a picture by its name, of a format that can be decoded or another.
pub(crate) fn is_picture(path: &Path) -> bool {
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    extension.is_some_and(|extension| EXTENSIONS.iter().chain(&OTHERS).any(|known| *known == extension))
}

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
    files_in(folder, is_picture)
}

/// As [`images_in`], files that `counts` says yes to.
pub(crate) fn files_in(folder: &Path, counts: impl Fn(&Path) -> bool) -> Vec<String> {
    let mut names = Vec::new();
    let mut open = vec![String::new()];
    while let Some(below) = open.pop() {
        for entry in std::fs::read_dir(folder.join(&below)).into_iter().flatten().flatten() {
            let name = format!("{below}{}", entry.file_name().to_string_lossy());
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => open.push(format!("{name}/")),
                _ if counts(Path::new(&name)) => names.push(name),
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

/// What is wrong where an image is of another shape than its camera.
pub(crate) fn disagreement(camera: &Intrinsics, width: u32, height: u32) -> String {
    let turned = camera.resized(height, width).is_some();
    let remedy = match turned {
        true => "it lies on its side, and no EXIF data say how to turn it: turn the file itself",
        false => "give the image that the camera was calibrated for, or a copy of it that was scaled as a whole",
    };
    format!("the image is {width} x {height} pixels and its camera {} x {}; {remedy}", camera.width, camera.height)
}

/// What the check of the files of photos found.
#[derive(Default)]
pub(crate) struct Settled {
    /// What is missing or unreadable, or does not fit its camera: files, or names of images that were not found.
    pub missing: Vec<String>,
    /// Photos whose intrinsics were rescaled to the stored image.
    pub rescaled: usize,
    /// Photos that are stored on their side and turned as their EXIF data say.
    pub turned: usize,
}

/// Reads the header of every image and mask. Images that cannot be read, are of another shape than their camera, or whose mask is, are
/// taken from their photos; intrinsics are rescaled to the stored images.
pub(crate) fn settle(photos: &mut [Photo]) -> Settled {
    let mut settled = Settled::default();
    for photo in photos {
        let Some(image) = &photo.image else {
            settled.missing.push(photo.camera.name.clone());
            continue;
        };
        let given = photo.camera.intrinsics;
        let fitted = match Header::read(image) {
            Err(e) => Err(unreadable(image, &e)),
            Ok(Header { width, height, .. }) => {
                let turned = quarter_turn(image, (width, height), &given);
                settled.turned += usize::from(turned.is_some());
                let (width, height) = if turned.is_some() { (height, width) } else { (width, height) };
                given.resized(width, height).ok_or_else(|| disagreement(&given, width, height))
            }
        };
        match fitted {
            Err(what) => {
                settled.missing.push(format!("{} ({what})", image.display()));
                photo.image = None;
                continue;
            }
            Ok(fitted) => {
                settled.rescaled += usize::from((given.width, given.height) != (fitted.width, fitted.height));
                photo.camera.intrinsics = fitted;
            }
        }
        let Some(mask) = &photo.mask else { continue };
        match Header::read(mask) {
            Err(e) => {
                settled.missing.push(format!("{} ({})", mask.display(), unreadable(mask, &e)));
                photo.mask = None;
            }
            Ok(Header { width, height, .. }) if given.resized(width, height).is_none() => {
                let Intrinsics { width: w, height: h, .. } = photo.camera.intrinsics;
                settled.missing.push(format!(
                    "{} (the mask is {width} x {height} pixels and its image {w} x {h}; make the masks again for these images)",
                    mask.display()
                ));
                // Without its mask, what it covers would count as the object.
                (photo.image, photo.mask) = (None, None);
            }
            Ok(_) => {}
        }
    }
    settled
}

/// Why an image cannot be read: its format, where it is one that others decode.
fn unreadable(path: &Path, error: &image::ImageError) -> String {
    let mut start = [0; 12];
    let read = std::fs::File::open(path).and_then(|mut file| std::io::Read::read_exact(&mut file, &mut start));
    // ISO base media files say at byte 8 what they are (ISO/IEC 14496-12, 4.3).
    let format = match (read, &start) {
        (Ok(()), [_, _, _, _, b'f', b't', b'y', b'p', brand @ ..]) => match brand {
            b"avif" | b"avis" => "AVIF",
            _ => "HEIC",
        },
        (Ok(()), [0, 0, 0, 12, b'J', b'X', b'L', b' ', ..] | [0xff, 0x0a, ..]) => "JPEG XL",
        (Ok(()), [b'I', b'I', 42, 0, ..] | [b'M', b'M', 0, 42, ..]) => "TIFF",
        (Ok(()), [b'B', b'M', ..]) => "BMP",
        (Ok(()), [b'G', b'I', b'F', ..]) => "GIF",
        _ => return error.to_string(),
    };
    format!("{format}, which is not read here; convert it to PNG, JPEG or WebP")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a user would not learn which format a photo is in that cannot be read.
    #[test]
    fn formats_that_are_not_read_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let said = |bytes: &[u8]| {
            let path = folder.path().join("a");
            std::fs::write(&path, bytes).unwrap();
            unreadable(&path, &Header::read(&path).unwrap_err())
        };
        let cases: [(&[u8], &str); 6] = [
            (b"\0\0\0\x1cftypavif\0\0", "AVIF, which"),
            (b"\0\0\0\x1cftypheic\0\0", "HEIC, which"),
            (b"\0\0\0\x0cJXL \r\n\x87\n", "JPEG XL, which"),
            (b"II*\0\x08\0\0\0\0\0\0\0\0", "TIFF, which"),
            (b"GIF89a\0\0\0\0\0\0", "GIF, which"),
            (b"nothing at all", "could not be determined"),
        ];
        for (bytes, expected) in cases {
            assert!(said(bytes).contains(expected), "{}", said(bytes));
        }
    }
}
