//! Photos as they arrive in a folder: which are whole, and which are of no use.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use exif::{In, Tag};
use serde::{Deserialize, Serialize};

use crate::engine::parallel::mapped;
use crate::files::io::folder::write_files;
use crate::files::io::photos::files::images_in;
use crate::files::photos::decode;
use crate::photogrammetry::frames::by_number;
use crate::photogrammetry::frames::choice::DUPLICATE;
use crate::photogrammetry::frames::grey::Grey;
use crate::photogrammetry::frames::motion::{self, Pyramid};
use crate::photogrammetry::frames::sharpness;
use crate::{Error, Result};

/// Photos before it that a photo may be a duplicate of.
const BEFORE: usize = 10;
/// Part of the median sharpness below which a photo is blurred, of at least so many photos.
const BLURRED: f64 = 0.45;
const ENOUGH: usize = 4;
/// Grey value that a twentieth of a photo must reach not to be dark.
const DARK: u8 = 45;

/// When and how large a file was written, by which it is known again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Stamp {
    /// Milliseconds since 1970.
    written: u64,
    bytes: u64,
}

impl Stamp {
    /// Of a file or folder; none where it is not there.
    pub fn of(file: &Path) -> Option<Self> {
        let metadata = fs::metadata(file).ok()?;
        let written = metadata.modified().ok()?.duration_since(UNIX_EPOCH).ok()?.as_millis() as u64;
        Some(Self { written, bytes: metadata.len() })
    }
}

/// What a look at a photo found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Look {
    /// Why it cannot be decoded.
    fault: Option<String>,
    /// See [`sharpness::of`].
    sharpness: f64,
    /// Checksum of the file (CRC-32): a photo that is written again under its name is another.
    checksum: u32,
    /// Grey value that a twentieth of it reaches.
    light: u8,
    /// Size, model of the camera and focal length: photos of which these agree have a lens in common.
    lens: String,
    /// The photo before it that shows the same from the same place.
    alike: Option<String>,
}

/// A photo in the folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    stamp: Stamp,
    look: Option<Look>,
}

/// A photo that has been looked at.
#[derive(Clone, Debug, PartialEq)]
pub struct Arrival {
    /// Path below the folder, with `/` between folders.
    pub name: String,
    /// Where it lies.
    pub file: PathBuf,
    /// When it was written, in milliseconds since 1970.
    pub written: u64,
    /// The same for photos of one lens.
    pub lens: String,
    /// Of the file: another where the photo is another.
    pub checksum: u32,
    /// Why it is of no use; none where it is.
    pub flaw: Option<String>,
}

/// The photos of a folder.
pub struct Inbox {
    folder: PathBuf,
    /// Folders in it that have photos, by their path from there; none for all.
    only: Option<Vec<String>>,
    /// Folders that had pictures at the last look, whether these count or not.
    folders: BTreeSet<String>,
    /// Where looks are kept for the next start.
    kept: PathBuf,
    entries: BTreeMap<String, Entry>,
    /// The last photos, small, for those that come next.
    recent: VecDeque<(String, Pyramid)>,
}

impl Inbox {
    /// Of a folder, hidden folders in it apart, and the one of the file `kept`: what an earlier run found is taken from there, and goes there.
    ///
    /// # Errors
    /// Where that file is of something else.
    pub fn open(folder: &Path, kept: &Path) -> Result<Self> {
        let entries = match fs::read(kept) {
            Ok(text) => serde_json::from_slice(&text).map_err(|_| {
                Error::input(
                    kept,
                    "this is not what an earlier run of `camsplat watch` wrote; remove it, or name another `out`",
                )
            })?,
            Err(_) => BTreeMap::new(),
        };
        let (folder, kept) = (folder.to_owned(), kept.to_owned());
        Ok(Self { folder, only: None, folders: BTreeSet::new(), kept, entries, recent: VecDeque::new() })
    }

    /// From now on takes photos in these folders alone, by their path from the folder; in all of them where there are none to name.
    pub fn look_only_in(&mut self, only: Option<Vec<String>>) {
        self.only = only;
    }

    /// Folders that had pictures at the last look, of photos or not.
    pub fn folders(&self) -> &BTreeSet<String> {
        &self.folders
    }

    /// Looks for photos that are new, changed or gone; whether there are any. A new photo is looked at once it has not grown since the last
    /// call.
    pub fn scan(&mut self) -> bool {
        let (mut fresh, mut waiting) = (Vec::new(), false);
        let folder = |name: &str| name.rsplit_once('/').map_or(String::new(), |(folder, _)| folder.to_owned());
        let mine = self.kept.parent().and_then(|work| inside(&self.folder, work));
        let counts = |name: &String| match &self.only {
            Some(only) => only.contains(&folder(name)),
            None => is_seen(name, mine.as_deref()),
        };
        let mut found = BTreeMap::new();
        let all = images_in(&self.folder);
        self.folders = all.iter().filter(|name| is_seen(name, mine.as_deref())).map(|name| folder(name)).collect();
        for name in all.into_iter().filter(counts) {
            // It may have gone since it was listed.
            let Some(stamp) = Stamp::of(&self.folder.join(&name)) else { continue };
            let before = self.entries.remove(&name).filter(|entry| entry.stamp == stamp);
            match before {
                Some(Entry { look: None, .. }) => fresh.push(name.clone()),
                Some(_) => {}
                None => waiting = true,
            }
            found.insert(name, before.unwrap_or(Entry { stamp, look: None }));
        }
        let gone = !std::mem::replace(&mut self.entries, found).is_empty();
        fresh.sort_by(|a, b| self.order(a, b));
        self.look_at(&fresh);
        let changed = gone || !fresh.is_empty();
        if changed || waiting {
            self.keep();
        }
        changed
    }

    /// The photos that have been looked at, in the order in which they were taken.
    pub fn photos(&self) -> Vec<Arrival> {
        let mut names: Vec<&String> =
            self.entries.iter().filter(|(_, entry)| entry.look.is_some()).map(|(name, _)| name).collect();
        names.sort_by(|a, b| self.order(a, b));
        let looks = || names.iter().filter_map(|name| Some((*name, self.entries[*name].look.as_ref()?)));
        let mut sharp: Vec<f64> =
            looks().filter(|(_, look)| look.fault.is_none()).map(|(_, look)| look.sharpness).collect();
        sharp.sort_by(f64::total_cmp);
        let median = if sharp.len() < ENOUGH { 0.0 } else { sharp[sharp.len() / 2] };
        let flaw = |look: &Look| match look {
            Look { fault: Some(fault), .. } => Some(format!("cannot be read: {fault}")),
            Look { light, .. } if *light < DARK => Some("too dark: find more light, or expose longer".into()),
            Look { sharpness: 0.0, .. } => Some("shows hardly any texture: take it from farther away".into()),
            Look { sharpness, .. } if *sharpness < BLURRED * median => {
                Some("blurred or of plain things alone: hold still, and have edges in it".into())
            }
            Look { alike: Some(other), .. } if self.entries.contains_key(other) => {
                Some(format!("shows the same as {other}: move before the next one"))
            }
            _ => None,
        };
        looks()
            .map(|(name, look)| Arrival {
                name: name.clone(),
                file: self.folder.join(name),
                written: self.entries[name].stamp.written,
                lens: look.lens.clone(),
                checksum: look.checksum,
                flaw: flaw(look),
            })
            .collect()
    }

    /// By when they were written, and by the numbers in their names.
    fn order(&self, a: &str, b: &str) -> std::cmp::Ordering {
        let written = |name: &str| self.entries.get(name).map(|entry| entry.stamp.written);
        written(a).cmp(&written(b)).then_with(|| by_number(a, b))
    }

    fn look_at(&mut self, names: &[String]) {
        self.recent.retain(|(name, _)| self.entries.contains_key(name) && !names.contains(name));
        let seen = mapped(names, |_, name| look(&self.folder.join(name)));
        for (name, (mut look, pyramid)) in names.iter().zip(seen) {
            if let Some(pyramid) = pyramid {
                let same = |(_, other): &&(String, Pyramid)| {
                    motion::between(other, &pyramid).is_some_and(|motion| motion < DUPLICATE)
                };
                look.alike = self.recent.iter().rev().find(same).map(|(name, _)| name.clone());
                if look.alike.is_none() {
                    self.recent.push_back((name.clone(), pyramid));
                }
                if self.recent.len() > BEFORE {
                    self.recent.pop_front();
                }
            }
            if let Some(entry) = self.entries.get_mut(name) {
                entry.look = Some(look);
            }
        }
    }

    /// Writes what is known. Where that fails photos are looked at again after the next start, and nothing else is lost.
    fn keep(&self) {
        // A folder that the user has deleted is not made again.
        if self.kept.parent().is_none_or(|folder| !folder.is_dir()) {
            return;
        }
        if let Ok(text) = serde_json::to_string(&self.entries) {
            let _ = write_files(&[(&self.kept, text.as_bytes())]);
        }
    }
}

/// The path of a file from a folder, with `/` between folders.
pub fn below(folder: &Path, file: &Path) -> Option<String> {
    Some(file.strip_prefix(folder).ok()?.to_string_lossy().replace('\\', "/"))
}

/// The path of the folder `work` from another that it lies in, however either is written.
pub fn inside(folder: &Path, work: &Path) -> Option<String> {
    below(&folder.canonicalize().ok()?, &work.canonicalize().ok()?).filter(|work| !work.is_empty())
}

/// Whether a file in the folder counts, by its path from there: not in hidden folders, nor in the folder `mine`.
pub fn is_seen(name: &str, mine: Option<&str>) -> bool {
    let own = mine.and_then(|mine| name.strip_prefix(mine)).is_some_and(|rest| rest.starts_with('/'));
    !own && !name.split('/').any(|part| part.starts_with('.'))
}

/// A look at a photo, and the photo small where it can be decoded.
fn look(file: &Path) -> (Look, Option<Pyramid>) {
    // One that cannot be read cannot be decoded either.
    let checksum = fs::read(file).map_or(0, |bytes| crc32fast::hash(&bytes));
    let image = match decode::encoded(file, [0; 3]) {
        Ok(image) => image,
        Err(error) => {
            let fault = Some(error.to_string().replace(&format!("{}: ", file.display()), ""));
            return (Look { fault, sharpness: 0.0, checksum, light: 0, lens: String::new(), alike: None }, None);
        }
    };
    let grey = Grey::of_colours(image.width as usize, image.height as usize, &image.pixels).within(sharpness::SIDE);
    let mut values = grey.values.clone();
    let brightest = values.len() - 1 - values.len() / 20;
    let light = *values.select_nth_unstable(brightest).1;
    let lens = format!("{} x {}{}", image.width, image.height, made_with(file).unwrap_or_default());
    let look = Look { fault: None, sharpness: sharpness::of(&grey), checksum, light, lens, alike: None };
    (look, Some(Pyramid::new(&grey)))
}

/// Model of the camera and focal length, where the photo says them.
fn made_with(file: &Path) -> Option<String> {
    let exif = exif::Reader::new().read_from_container(&mut BufReader::new(File::open(file).ok()?)).ok()?;
    let field = |tag| exif.get_field(tag, In::PRIMARY).map(|field| format!(", {}", field.display_value()));
    Some([Tag::Model, Tag::FocalLength].into_iter().filter_map(field).collect())
}

#[cfg(test)]
mod tests {
    use image::{Rgb, RgbImage};

    use super::*;
    use crate::scene::random;

    /// A picture of tiles in different greys, moved to the right, blurred over so many pixels, and darkened.
    fn picture(shift: u32, blur: u32, light: f64) -> RgbImage {
        let value = |x: u32, y: u32| 255.0 * random::uniforms(3, (x + shift) / 6, y / 6)[0];
        RgbImage::from_fn(320, 240, |x, y| {
            let sum: f64 = (0..=blur).map(|k| value(x + k, y)).sum();
            Rgb([(light * sum / f64::from(blur + 1)) as u8; 3])
        })
    }

    /// If this failed, a photographer would walk on with photos that are of no use, or be sent back for those that are.
    #[test]
    fn photos_of_no_use_are_named_with_the_reason() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        let mut inbox = Inbox::open(place.path(), &at(".camsplat/photos.json")).unwrap();
        fs::create_dir(at(".camsplat")).unwrap();
        assert!(!inbox.scan() && inbox.photos().is_empty());
        for (name, shift, blur, light) in [
            ("a.png", 0, 0, 1.0),
            ("b.png", 37, 0, 1.0),
            ("c.png", 74, 0, 1.0),
            ("d.png", 110, 24, 1.0),
            ("e.png", 150, 0, 0.1),
            ("f.png", 74, 0, 1.0),
            ("g.png", 190, 0, 1.0),
        ] {
            picture(shift, blur, light).save(at(name)).unwrap();
        }
        fs::write(at("h.png"), "no picture").unwrap();
        RgbImage::from_pixel(320, 240, Rgb([230; 3])).save(at("i.png")).unwrap();
        fs::write(at("notes.txt"), "no picture either").unwrap();
        assert!(!inbox.scan(), "photos that may still be growing were looked at");
        assert!(inbox.scan() && !inbox.scan());
        let flaws: BTreeMap<String, String> =
            inbox.photos().into_iter().filter_map(|photo| Some((photo.name, photo.flaw?))).collect();
        let begins = |name: &str| flaws[name].split([':', ' ']).next().unwrap_or_default().to_owned();
        assert_eq!(flaws.keys().collect::<Vec<_>>(), ["d.png", "e.png", "f.png", "h.png", "i.png"], "{flaws:?}");
        assert_eq!(["d.png", "e.png", "h.png"].map(begins), ["blurred", "too", "cannot"]);
        assert!(flaws["f.png"].contains("the same as c.png") && flaws["i.png"].contains("texture"), "{flaws:?}");
        // After another start nothing is looked at again, and what is gone is gone; of a duplicate's twin, too.
        let mut again = Inbox::open(place.path(), &at(".camsplat/photos.json")).unwrap();
        assert!(!again.scan() && again.photos() == inbox.photos());
        fs::remove_file(at("c.png")).unwrap();
        assert!(again.scan());
        // One that is copied again is no duplicate of itself, and has the same checksum; another under its name has not.
        let checksum =
            |inbox: &Inbox| inbox.photos().iter().find(|photo| photo.name == "g.png").map(|photo| photo.checksum);
        let before = checksum(&again);
        for (shift, same) in [(190, true), (230, false)] {
            fs::remove_file(at("g.png")).unwrap();
            picture(shift, 0, 1.0).save(at("g.png")).unwrap();
            let ten_seconds = std::time::SystemTime::now() + std::time::Duration::from_secs(10);
            File::options().append(true).open(at("g.png")).unwrap().set_modified(ten_seconds).unwrap();
            again.scan();
            again.scan();
            assert!(again.photos().iter().all(|photo| photo.name != "g.png" || photo.flaw.is_none()));
            assert_eq!(checksum(&again) == before, same);
        }
        let left = again.photos();
        assert!(left.len() == 8 && left.iter().all(|photo| photo.name != "f.png" || photo.flaw.is_none()), "{left:?}");
    }
}
