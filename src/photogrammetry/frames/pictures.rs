//! Folders of pictures, in the order of their names.

use std::cmp::Ordering;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::grey::Grey;
use super::sharpness;
use crate::engine::parallel::{mapped, threads};
use crate::error::{Error, Result};
use crate::files::photos::decode;

/// The pictures of a folder.
#[derive(Clone, Debug)]
pub struct Pictures {
    /// The folder that they lie in.
    pub folder: PathBuf,
    /// Their names, in the order in which they were taken.
    pub names: Vec<String>,
}

impl Pictures {
    /// The PNG and JPEG files of a folder, or of `images` in it where it has none itself. Numbers in names count by their value, so
    /// that 10.jpg comes after 9.jpg.
    ///
    /// # Errors
    /// Where there are none.
    pub fn find(folder: &Path) -> Result<Self> {
        for folder in [folder.to_owned(), folder.join("images")] {
            let mut names = listed(&folder, |name| ends_in(name, &["jpg", "jpeg", "png"]))?;
            if !names.is_empty() {
                names.sort_by(|a, b| by_number(a, b));
                return Ok(Self { folder, names });
            }
        }
        let videos = listed(folder, crate::files::io::photos::is_video)?;
        let what = match &videos[..] {
            [] => "the folder has no pictures (.jpg, .png); give a folder of frames, or a video".into(),
            [first, ..] => {
                format!(
                    "the folder has no pictures, but the video {first:?}; give that: {}",
                    folder.join(first).display()
                )
            }
        };
        Err(Error::input(folder, what))
    }

    /// Names to write the pictures under: their own, after a number where the order of the names as COLMAP compares them is
    /// another than that of the pictures.
    pub fn written(&self) -> Vec<String> {
        match self.names.is_sorted() {
            true => self.names.clone(),
            false => self.names.iter().enumerate().map(|(i, name)| format!("{i:06}_{name}")).collect(),
        }
    }

    /// Gives `take` every picture in its order, shrunk to the size that sharpness is measured at. The size of the pictures is returned.
    ///
    /// # Errors
    /// Where one cannot be decoded or is of another size than the first; [`Error::Interrupted`] where `take` asks for a stop.
    pub fn analyse(&self, mut take: impl FnMut(Grey) -> ControlFlow<()>) -> Result<[u32; 2]> {
        let mut size = [0; 2];
        // As many at a time as there are threads: large pictures take much memory while they are decoded.
        for names in self.names.chunks(threads().max(1)) {
            let decoded = mapped(names, |_, name| {
                let image = decode::encoded(&self.folder.join(name), [0; 3])?;
                let grey = Grey::of_colours(image.width as usize, image.height as usize, &image.pixels);
                Ok(([image.width, image.height], grey.within(sharpness::SIDE)))
            });
            for (name, decoded) in names.iter().zip(decoded) {
                let (found, grey) = decoded?;
                if size != [0; 2] && size != found {
                    let what = format!(
                        "it is {} x {} pixels and the pictures before it are {} x {}; give pictures of one camera, all upright or all on \
                         their side",
                        found[0], found[1], size[0], size[1]
                    );
                    return Err(Error::input(self.folder.join(name), what));
                }
                size = found;
                Error::unless_stopped(take(grey))?;
            }
        }
        Ok(size)
    }
}

/// Names of the files in a folder that `fits`; none where there is no such folder.
fn listed(folder: &Path, fits: impl Fn(&str) -> bool) -> Result<Vec<String>> {
    let entries = match std::fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(source) => return Err(Error::io(folder, source)),
    };
    let files = entries.flatten().filter(|entry| entry.path().is_file());
    let names = files.filter_map(|entry| entry.file_name().into_string().ok());
    // Hidden files are other programs' (macOS writes one beside each picture).
    let mut names: Vec<String> = names.filter(|name| !name.starts_with('.') && fits(name)).collect();
    names.sort_unstable();
    Ok(names)
}

fn ends_in(name: &str, extensions: &[&str]) -> bool {
    let extension = name.rsplit_once('.').map(|(_, extension)| extension.to_lowercase());
    extension.is_some_and(|extension| extensions.contains(&extension.as_str()))
}

/// Compares names with each number in them by its value.
pub fn by_number(a: &str, b: &str) -> Ordering {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let (mut x, mut y) = (a, b);
    while let (Some(p), Some(q)) = (x.chars().next(), y.chars().next()) {
        let order = if p.is_ascii_digit() && q.is_ascii_digit() {
            let (m, n) = (digits(x), digits(y));
            let [i, j] = [x[..m].trim_start_matches('0'), y[..n].trim_start_matches('0')];
            (x, y) = (&x[m..], &y[n..]);
            // Without zeros in front the longer number is larger, whatever its length.
            i.len().cmp(&j.len()).then_with(|| i.cmp(j))
        } else {
            (x, y) = (&x[p.len_utf8()..], &y[q.len_utf8()..]);
            p.cmp(&q)
        };
        if order != Ordering::Equal {
            return order;
        }
    }
    x.len().cmp(&y.len()).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, frames would be taken in another order than they were filmed, and seem to jump to and fro.
    #[test]
    fn numbers_count_by_their_value() {
        let mut names = [
            "10.jpg",
            "9.jpg",
            "a2b10.png",
            "a2b9.png",
            "a02b9.png",
            "é1",
            "é",
            "b",
            "123456789012345678901.jpg",
            "007.jpg",
        ];
        names.sort_by(|a, b| by_number(a, b));
        let known = [
            "007.jpg",
            "9.jpg",
            "10.jpg",
            "123456789012345678901.jpg",
            "a02b9.png",
            "a2b9.png",
            "a2b10.png",
            "b",
            "é",
            "é1",
        ];
        assert_eq!(names, known);
        let folder = tempfile::tempdir().unwrap();
        for name in ["10.jpg", "9.JPG", ".9.jpg", "readme.txt"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let found = Pictures::find(folder.path()).unwrap();
        assert_eq!(
            (&found.names[..], found.written()),
            (&["9.JPG", "10.jpg"].map(String::from)[..], vec!["000000_9.JPG".into(), "000001_10.jpg".into()])
        );
    }

    /// If this failed, a folder that holds the video itself would be refused without saying what to give.
    #[test]
    fn folders_without_pictures_are_refused_with_the_next_step() {
        let folder = tempfile::tempdir().unwrap();
        let refused = || Pictures::find(folder.path()).unwrap_err().to_string();
        assert!(refused().contains("no pictures (.jpg, .png)"), "{}", refused());
        std::fs::write(folder.path().join("walk.MOV"), "").unwrap();
        assert!(refused().contains("the video \"walk.MOV\"; give that"), "{}", refused());
        std::fs::create_dir(folder.path().join("images")).unwrap();
        std::fs::write(folder.path().join("images/a.png"), "").unwrap();
        assert_eq!(Pictures::find(folder.path()).unwrap().folder, folder.path().join("images"));
    }
}
