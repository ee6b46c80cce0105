//! Cameras of RealityCapture (now RealityScan), as its registration export "Internal/External camera parameters" writes them (.csv): a
//! header that names the columns, and for each image a position, three angles and the lens as shares of the image's size.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};

use super::lookup::Lookup;
use super::{Found, files};
use crate::error::{Error, Result};
use crate::files::io::left_out::LeftOut;
use crate::files::io::{checks, read_file};
use crate::files::photos::{Convention, Photo};
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::lens::Distortion;

/// Columns that a file must have, in any order; beside them [`LENS`].
const NEEDED: [&str; 7] = ["x", "y", "alt", "heading", "pitch", "roll", "f"];
/// Columns that count as zero where a file's template leaves them out.
const LENS: [&str; 8] = ["px", "py", "k1", "k2", "k3", "k4", "t1", "t2"];
/// Width in millimetres of the film that focal lengths are given for.
const FILM: f64 = 36.0;

/// A row of the file: a camera whose lens is known once the size of its image is.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the image.
    pub name: String,
    /// World-from-camera, OpenCV axes.
    pub pose: Pose,
    /// Focal length in millimetres, on film that is as wide as the image's longer side.
    pub focal: f64,
    /// Principal point from the image's centre, in shares of its longer side.
    pub principal: [f64; 2],
    /// What the pinhole does not explain.
    pub distortion: Distortion,
}

impl Row {
    /// The pinhole of an image of so many pixels.
    pub fn intrinsics(&self, width: u32, height: u32) -> Intrinsics {
        let longer = f64::from(width.max(height));
        let [px, py] = self.principal.map(|share| share * longer);
        Intrinsics {
            width,
            height,
            focal: [self.focal * longer / FILM; 2],
            principal: [0.5 * f64::from(width) + px, 0.5 * f64::from(height) + py],
        }
    }
}

/// The rows of the file, and a note where it leaves columns of the lens out. Lines before the header are passed over; rows of another
/// number of columns, or with a value that is no number, are left out. Columns lie between commas, semicolons (then numbers may have
/// a decimal comma) or tabs.
///
/// # Errors
/// Where the file has no such header, or no row is left.
pub fn parse(path: &Path, bytes: &[u8], notes: &mut Vec<String>) -> Result<Vec<Row>> {
    const AGAIN: &str = "export \"Internal/External camera parameters\" from RealityCapture again";
    let refuse = |what: String| Error::input(path, format!("{what}; {AGAIN}"));
    let text = std::str::from_utf8(bytes).map_err(|_| refuse("it is no text".into()))?;
    let mut lines = (1..).zip(text.trim_start_matches('\u{feff}').lines()).filter(|(_, line)| !line.trim().is_empty());
    let columns = |line: &str, between: char| -> Vec<String> {
        line.split(between).map(|name| name.trim().trim_start_matches('#').to_lowercase()).collect()
    };
    let named = |line: &str| {
        let headers = [',', ';', '\t'].map(|between| (between, columns(line, between)));
        headers.into_iter().find(|(_, header)| header.len() > 1 && header.iter().any(|name| name == "name"))
    };
    let header = lines.by_ref().find_map(|(_, line)| named(line));
    let (between, header) =
        header.ok_or_else(|| refuse("no line of it names columns, of which one is \"name\"".into()))?;
    let number = |name: &str| header.iter().filter(|column| *column == name).count();
    if let Some(name) = ["name"].iter().chain(&NEEDED).chain(&LENS).find(|name| number(name) > 1) {
        return Err(refuse(format!("it has {} columns {name:?}", number(name))));
    }
    let place = |name: &str| header.iter().position(|column| column == name);
    let absent =
        |names: &[&'static str]| -> Vec<&str> { names.iter().copied().filter(|name| place(name).is_none()).collect() };
    let missing = absent(&NEEDED);
    if !missing.is_empty() {
        return Err(refuse(format!("it has no columns {}", missing.join(", "))));
    }
    let missing = absent(&LENS);
    if !missing.is_empty() {
        notes.push(format!("the file has no columns {}, which are taken for zero", missing.join(", ")));
    }
    let mut rows = Vec::new();
    let mut left_out = LeftOut::default();
    for (number, line) in lines {
        let fields: Vec<&str> = line.split(between).map(str::trim).collect();
        let read = || -> Result<Row, String> {
            if fields.len() != header.len() {
                return Err(format!("line {number} has {} columns and the header {}", fields.len(), header.len()));
            }
            let value = |name: &str| -> Result<f64, String> {
                let Some(field) = place(name).map(|place| fields[place]) else { return Ok(0.0) };
                let number_of = if between == ';' { field.replace(',', ".") } else { field.to_owned() };
                number_of.parse().map_err(|_| format!("line {number}: {name} is {field:?} and no number"))
            };
            Ok(Row {
                name: place("name").map(|place| fields[place]).unwrap_or_default().into(),
                pose: Pose {
                    position: DVec3::new(value("x")?, value("y")?, value("alt")?),
                    rotation: rotation([value("heading")?, value("pitch")?, value("roll")?]),
                },
                focal: value("f")?,
                principal: [value("px")?, value("py")?],
                distortion: Distortion {
                    radial: [value("k1")?, value("k2")?, value("k3")?, value("k4")?, 0.0, 0.0],
                    tangential: [value("t1")?, value("t2")?],
                    ..Distortion::default()
                },
            })
        };
        match read() {
            Ok(row) => rows.push(row),
            Err(what) => left_out.add(what),
        }
    }
    if let Some(what) = left_out.first().filter(|_| rows.is_empty()) {
        return Err(refuse(what.into()));
    }
    left_out.note("rows", notes);
    Ok(rows)
}

/// World-from-camera rotation, OpenCV axes, of heading, pitch and roll in degrees: a camera without any looks down with its picture's up to
/// the north (Y); it is rolled about its own Y, pitched about X, and turned clockwise from north by its heading.
fn rotation(degrees: [f64; 3]) -> DQuat {
    let [heading, pitch, roll] = degrees.map(f64::to_radians);
    let opengl = DQuat::from_rotation_z(-heading) * DQuat::from_rotation_x(pitch) * DQuat::from_rotation_y(roll);
    opengl * DQuat::from_rotation_x(std::f64::consts::PI)
}

/// Reads a file of cameras, whose images lie beside it or in `images/`. Images that are missing are taken to be as large as the first that
/// is there.
pub(super) fn read(path: &Path) -> Result<Found> {
    let mut notes = Vec::new();
    let rows = parse(path, &read_file(path)?, &mut notes)?;
    let root = path.parent().unwrap_or(Path::new(""));
    let folders: Vec<PathBuf> = files::image_folders(root).into_iter().chain([root.to_owned()]).collect();
    let lookup = Lookup::default();
    let images: Vec<Option<PathBuf>> = rows.iter().map(|row| lookup.image(&folders, &row.name)).collect();
    let sizes: Vec<Option<(u32, u32)>> = images.iter().map(|image| image.as_deref().and_then(files::size)).collect();
    let Some(usual) = sizes.iter().flatten().next().copied() else {
        let what =
            "none of its images can be read, and its lenses are shares of their size; put them beside it or in images/";
        return Err(Error::input(path, what));
    };
    let unknown = sizes.iter().filter(|size| size.is_none()).count();
    if unknown > 0 {
        let (width, height) = usual;
        notes.push(format!("the size of {unknown} images is not known, and taken to be {width} x {height} pixels"));
    }
    let mut photos = Vec::with_capacity(rows.len());
    for ((row, image), size) in rows.into_iter().zip(images).zip(sizes) {
        let (width, height) = size.unwrap_or(usual);
        let stored = image.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
        let intrinsics = row.intrinsics(width, height);
        let camera = Camera { name: stored.unwrap_or(row.name), pose: row.pose, intrinsics };
        let mask = files::mask(root, &camera.name);
        photos.push(Photo { camera, distortion: row.distortion, image, mask });
    }
    photos.sort_by(|a, b| a.camera.name.cmp(&b.camera.name));
    let mut left_out = LeftOut::default();
    checks::usable_photos(path, &mut photos, &mut left_out)?;
    left_out.note("cameras", &mut notes);
    Ok(Found { photos, convention: Convention::RealityCapture, notes, ..Found::default() })
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;

    const HEADER: &str = "#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2\n";

    fn rows(text: &str) -> Result<Vec<Row>> {
        parse(Path::new("cameras.csv"), text.as_bytes(), &mut Vec::new())
    }

    /// If this failed, cameras of RealityCapture would look elsewhere. The angles and the matrix (camera-from-world, OpenCV axes) are those
    /// that the program itself exported for one camera, as .csv and as .xmp; a user of it published both.
    #[test]
    fn angles_are_those_of_the_program() {
        let row = "a.jpg,1,2,3,163.736597399311,83.4154313461628,174.386496244756,18,0,0,0,0,0,0,0,0\n";
        let pose = rows(&format!("{HEADER}{row}")).unwrap()[0].pose;
        let exported = DMat3::from_cols_array(&[
            0.982594073038806,
            0.185426733553445,
            -0.0112166890261935,
            -0.032113633044729,
            0.11008102707942,
            -0.993403685341366,
            -0.18296885582437,
            0.976472781986697,
            0.114119690840277,
        ]);
        // By rows there, by columns here: world-from-camera.
        assert!(DMat3::from_quat(pose.rotation).abs_diff_eq(exported, 1e-9), "{pose:?}");
        assert_eq!(pose.position, DVec3::new(1.0, 2.0, 3.0));
        let down = rotation([0.0; 3]);
        assert!((down * DVec3::Z).distance(DVec3::NEG_Z) < 1e-12 && (down * DVec3::NEG_Y).distance(DVec3::Y) < 1e-12);
        let east = rotation([90.0, 90.0, 0.0]);
        assert!((east * DVec3::Z).distance(DVec3::X) < 1e-12 && (east * DVec3::NEG_Y).distance(DVec3::Z) < 1e-12);
    }

    /// If this failed, columns in another order would be read as others, or lenses would not fit the stored images.
    #[test]
    fn columns_go_by_name_and_lenses_by_the_images() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cameras.csv");
        std::fs::create_dir(folder.path().join("images")).unwrap();
        for (name, width, height) in [("a.png", 72, 48), ("b.png", 36, 54)] {
            image::RgbImage::new(width, height).save(folder.path().join("images").join(name)).unwrap();
        }
        let text = "#cameras 3\n#name, alt,x,y,heading,pitch,roll,px,py,f,k1,k2,k3,t1,t2,note\n\
            b.png,3,1,2,0,0,0,0.1,-0.05,18,0,0,0,0,0,old\n\n\
            a.JPG,6,4,5,0,0,0,0,0,36,-0.2,0.03,0.004,0.001,0.002,\nc.png,9,7,8,0,0,0,0,0,36,0,0,0,0,0,\n";
        std::fs::write(&file, text).unwrap();
        let found = read(&file).unwrap();
        let [a, b, c] = &found.photos[..] else { panic!("{} photos", found.photos.len()) };
        assert_eq!((&a.camera.name[..], a.camera.pose.position), ("a.png", DVec3::new(4.0, 5.0, 6.0)));
        assert_eq!((a.camera.intrinsics.focal, a.camera.intrinsics.principal), ([72.0; 2], [36.0, 24.0]));
        assert_eq!(
            (a.distortion.radial[..4].to_vec(), a.distortion.tangential),
            (vec![-0.2, 0.03, 0.004, 0.0], [0.001, 0.002])
        );
        let [cx, cy] = b.camera.intrinsics.principal;
        assert!((cx - 23.4).abs() < 1e-12 && (cy - 24.3).abs() < 1e-12, "{b:?}");
        assert_eq!(b.camera.intrinsics.focal, [27.0; 2]);
        assert!(c.image.is_none() && c.camera.intrinsics.width == 36, "{c:?}");
        assert!(found.notes[0].contains("no columns k4") && found.notes[1].contains("1 images"), "{:?}", found.notes);
    }

    /// If this failed, exports of systems with a decimal comma would be refused, or one bad row lose all others.
    #[test]
    fn semicolons_divide_too_and_bad_rows_are_left_out() {
        let known = rows(&format!("{HEADER}a.jpg,1.5,2,3,10,80,1,18,0,0,0,0,0,0,0,0\n")).unwrap();
        let header = HEADER.replace(',', ";");
        for x in ["1.5", "1,5"] {
            assert_eq!(rows(&format!("{header}a.jpg;{x};2;3;10;80;1;18;0;0;0;0;0;0;0;0\n")).unwrap(), known);
        }
        let text = format!(
            "{HEADER}b.jpg,1\na.jpg,1.5,2,3,10,80,1,18,0,0,0,0,0,0,0,0\nc.jpg,x,2,3,10,80,1,18,0,0,0,0,0,0,0,0\n"
        );
        let mut notes = Vec::new();
        assert_eq!(parse(Path::new("cameras.csv"), text.as_bytes(), &mut notes).unwrap(), known);
        assert_eq!(
            notes,
            ["rows left out: 2; line 2 has 2 columns and the header 16; line 4: x is \"x\" and no number"]
        );
    }

    /// If this failed, a table of other columns would give cameras that cannot be, or end the program.
    #[test]
    fn other_tables_are_refused() {
        let row = "a.jpg,1,2,3,10,80,1,18,0,0,0,0,0,0,0,0\n";
        for (text, fragment) in [
            (String::new(), "names columns"),
            (row.into(), "names columns"),
            ("#name,x,y,z,heading,pitch,roll\na.jpg,1,2,3,10,80,1\n".into(), "no columns alt, f;"),
            ("#name,x,y,alt,heading,pitch,roll,f,x\n".into(), "2 columns \"x\""),
            (format!("{HEADER}a.jpg,1,2\n"), "line 2 has 3 columns and the header 16"),
            (format!("{HEADER}{}", row.replace("80", "steep")), "line 2: pitch is \"steep\""),
        ] {
            let message = rows(&text).unwrap_err().to_string();
            assert!(message.contains(fragment) && message.contains("export"), "{fragment:?} is not in {message}");
        }
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("cameras.csv");
        std::fs::write(&file, format!("{HEADER}{row}")).unwrap();
        assert!(read(&file).err().unwrap().to_string().contains("beside it or in images/"));
        image::RgbImage::new(8, 8).save(folder.path().join("a.jpg")).unwrap();
        assert!(read(&file).is_ok());
        std::fs::write(&file, format!("{HEADER}{}", row.replace("80", "NaN"))).unwrap();
        assert!(read(&file).err().unwrap().to_string().contains("not finite"));
    }
}
