use std::fs;

use glam::DVec3;
use image::RgbImage;
use tempfile::TempDir;

use super::*;
use crate::files::photos::orientation::{QUARTER, with_exif};

/// A hand-written capture: cameras a.jpg and sub/b.jpg of 40 x 20 pixels look along z at two points.
const CAMERAS: &str = "1 OPENCV 40 20 30 30 20 10 0.1 0 0 0\n";
const IMAGES: &str = "7 1 0 0 0 0 0 0 1 sub/b.jpg\n\n3 1 0 0 0 -1 0 0 1 a.jpg\n\n";
const POINTS: &str = "5 0 0 5 10 20 30 0.5 7 0 3 0\n6 1 0 5 10 20 30 1.5 3 1\n";

struct Place(TempDir);

impl Place {
    fn new(files: &[(&str, &str)]) -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        for (name, text) in files {
            fs::write(place.path(name), text).unwrap();
        }
        place
    }

    fn colmap() -> Self {
        Self::new(&[
            ("sparse/0/cameras.txt", CAMERAS),
            ("sparse/0/images.txt", IMAGES),
            ("sparse/0/points3D.txt", POINTS),
        ])
    }

    /// A path in the folder, with the folders above it made.
    fn path(&self, name: &str) -> PathBuf {
        let path = self.0.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    }

    fn image(&self, name: &str, width: u32, height: u32) {
        RgbImage::new(width, height).save(self.path(name)).unwrap();
    }

    fn read(&self, images: Images) -> Result<PhotoSet> {
        read(self.0.path(), &ReadOptions { images, ..ReadOptions::default() })
    }

    #[track_caller]
    fn refusal(&self, images: Images) -> String {
        let message = self.read(images).unwrap_err().to_string();
        assert_eq!(message.lines().count(), 1, "{message}");
        message
    }
}

fn file(path: &Option<PathBuf>) -> String {
    path.as_ref().unwrap().file_name().unwrap().to_string_lossy().into_owned()
}

/// If this failed, photos would be given the images, masks or tracks of others.
#[test]
fn a_capture_by_hand() {
    let place = Place::colmap();
    place.image("images/a.jpg", 40, 20);
    place.image("images/sub/b.jpg", 40, 20);
    place.image("images/stray.png", 3, 3);
    place.image("masks/a.jpg.png", 40, 20);
    place.image("mask/sub/b.png", 20, 10);
    let set = place.read(Images::Needed).unwrap();
    let [a, b] = &set.photos[..] else { panic!("{} photos", set.photos.len()) };
    assert_eq!((a.camera.name.as_str(), b.camera.name.as_str()), ("a.jpg", "sub/b.jpg"));
    assert_eq!((file(&a.mask), file(&b.mask)), ("a.jpg.png".into(), "b.png".into()));
    assert_eq!(a.camera.pose.position, DVec3::X);
    assert_eq!(a.distortion.radial[0], 0.1);
    assert_eq!((&set.tracks, &set.errors), (&vec![vec![0, 1], vec![0]], &vec![0.5, 1.5]));
    for fragment in
        ["left out, for they have no pose: stray.png (1 in all)", "2 images found, 2 with a mask", "error of 1.00"]
    {
        assert!(set.notes.iter().any(|note| note.contains(fragment)), "{fragment:?} is not in {:?}", set.notes);
    }
    // From the model's own folder, the same images are found.
    let inner = read(&place.path("sparse/0"), &ReadOptions::default()).unwrap();
    assert_eq!(inner.photos, set.photos);
}

/// If this failed, splats would start flat along the normals of other points, or as balls where normals are known.
#[test]
fn normals_come_from_a_cloud_of_the_same_points() {
    let place = Place::colmap();
    let normals = |points: &[[f64; 3]]| {
        let vertices: String = points.iter().map(|[x, y, z]| format!("{x} {y} {z} 0 0 -1\n")).collect();
        let names: String =
            ["x", "y", "z", "nx", "ny", "nz"].iter().map(|name| format!("property float {name}\n")).collect();
        let count = points.len();
        let text = format!("ply\nformat ascii 1.0\nelement vertex {count}\n{names}end_header\n{vertices}");
        fs::write(place.path("points.ply"), text).unwrap();
        place.read(Images::Optional).unwrap().points.normals
    };
    assert_eq!(normals(&[[0.0, 0.0, 5.000_000_1], [1.0, 0.0, 5.0]]), [-DVec3::Z; 2]);
    assert!(normals(&[[0.0, 0.0, 5.0], [1.0, 0.1, 5.0]]).is_empty(), "another point");
    assert!(normals(&[[0.0, 0.0, 5.0]]).is_empty(), "fewer points");
    fs::write(place.path("points.ply"), "no cloud").unwrap();
    assert!(place.read(Images::Optional).unwrap().points.normals.is_empty());
}

/// If this failed, shrunk copies of photos would get the lens of the originals.
#[test]
fn shrunk_copies_rescale_the_lens() {
    let place = Place::colmap();
    place.image("images_2/a.png", 20, 10);
    place.image("images_2/sub/b.jpg", 20, 10);
    place.image("images_4/sub/b.jpg", 10, 5);
    let set = place.read(Images::Needed).unwrap();
    for photo in &set.photos {
        let k = photo.camera.intrinsics;
        assert_eq!((k.width, k.height, k.focal, k.principal), (20, 10, [15.0; 2], [10.0, 5.0]));
    }
    assert!(set.notes.iter().any(|note| note.contains("of 2 cameras were rescaled")), "{:?}", set.notes);
}

/// If this failed, portrait photos of phones, of which other programs turned the pixels before they found the poses, would be refused.
#[test]
fn photos_on_their_side_are_turned_as_exif_says() {
    let place = Place::colmap();
    place.image("images/a.png", 40, 20);
    place.image("images/sub/b.jpg", 20, 40);
    let file = place.path("images/sub/b.jpg");
    assert!(place.read(Images::Needed).unwrap_err().to_string().contains("no EXIF data say how to turn it"));
    fs::write(&file, with_exif(&fs::read(&file).unwrap(), QUARTER)).unwrap();
    let set = place.read(Images::Needed).unwrap();
    let sizes: Vec<_> = set.photos.iter().map(|p| [p.camera.intrinsics.width, p.camera.intrinsics.height]).collect();
    assert_eq!(sizes, [[40, 20]; 2]);
    assert!(set.notes.iter().any(|note| note.starts_with("1 photos are stored on their side")), "{:?}", set.notes);
}

/// If this failed, a capture would be used as if it were whole, or a user would not learn which files are missing.
#[test]
fn missing_images_are_listed_skipped_or_borne() {
    let place = Place::colmap();
    place.image("images/a.jpg", 40, 20);
    let message = place.refusal(Images::Needed);
    assert!(message.contains("missing or unreadable: sub/b.jpg (1 in all)"), "{message}");
    fs::write(place.path("images/sub/b.jpg"), "no image").unwrap();
    let message = place.refusal(Images::Needed);
    assert!(message.contains("images/sub/b.jpg (") && message.contains("`skip_missing`"), "{message}");
    let borne = place.read(Images::Optional).unwrap();
    assert_eq!((borne.photos.len(), borne.missing.len(), &borne.photos[1].image), (2, 1, &None));
    assert!(borne.notes.iter().any(|note| note.starts_with("missing or unreadable: ")), "{:?}", borne.notes);
    let skipped = place.read(Images::SkipMissing).unwrap();
    assert_eq!((skipped.photos.len(), &skipped.tracks), (1, &vec![vec![0], vec![0]]));
    fs::remove_file(place.path("images/a.jpg")).unwrap();
    assert!(place.refusal(Images::SkipMissing).contains("no photo has an image that can be read"));
}

/// If this failed, images that were cropped or turned would be taken for what the cameras saw, or one such lose all others.
#[test]
fn images_of_another_shape_are_not_used() {
    for (width, height, fragment) in
        [(40, 24, "scaled as a whole"), (10, 20, "lies on its side"), (20, 40, "on its side")]
    {
        let place = Place::colmap();
        place.image("images/a.jpg", width, height);
        place.image("images/sub/b.jpg", 40, 20);
        let message = place.refusal(Images::Needed);
        let size = format!("{width} x {height} pixels and its camera 40 x 20");
        assert!(message.contains("a.jpg") && message.contains(&size) && message.contains(fragment), "{message}");
        let skipped = place.read(Images::SkipMissing).unwrap();
        assert_eq!(skipped.photos.iter().map(|photo| &photo.camera.name[..]).collect::<Vec<_>>(), ["sub/b.jpg"]);
    }
    let place = Place::colmap();
    place.image("images/a.jpg", 40, 20);
    place.image("images/sub/b.jpg", 40, 20);
    place.image("masks/a.jpg.png", 20, 20);
    assert!(place.refusal(Images::Needed).contains("the mask is 20 x 20"));
}

/// If this failed, one bad item of a model would lose a whole capture, or be gone without a word.
#[test]
fn a_bad_part_of_a_model_is_left_out_and_named() {
    let read = |file: &str, text: &str| {
        let place = Place::colmap();
        place.image("images/a.jpg", 40, 20);
        place.image("images/sub/b.jpg", 40, 20);
        fs::write(place.path(file), text).unwrap();
        let set = place.read(Images::Needed).unwrap();
        let names: Vec<String> = set.photos.iter().map(|photo| photo.camera.name.clone()).collect();
        (names.join(" "), set.points.positions.len(), set.tracks.len(), set.notes.join("\n"))
    };
    let zero = IMAGES.replace("7 1 0 0 0", "7 0 0 0 0");
    let (names, points, _, notes) = read("sparse/0/images.txt", &zero);
    assert!(names == "a.jpg" && points == 2, "{names} {points}");
    assert!(notes.contains("images left out: 1; image \"sub/b.jpg\" has a pose that is not finite"), "{notes}");
    let unused = format!("{CAMERAS}2 PINHOLE 40 20 -nan(ind) 30 20 10\n");
    let (names, _, _, notes) = read("sparse/0/cameras.txt", &unused);
    assert!(names == "a.jpg sub/b.jpg" && notes.contains("cameras of the model left out: 1; line 2"), "{notes}");
    let (_, points, tracks, notes) = read("sparse/0/points3D.txt", &format!("{POINTS}7 nan 0 5 1 2 3 0.5 7 1\n"));
    assert!(points == 2 && tracks == 2 && notes.contains("points left out: 1; point 7 is at"), "{notes}");
    let (names, points, ..) = read("sparse/0/points3D.txt", "");
    assert!(names == "a.jpg sub/b.jpg" && points == 0);
}

/// If this failed, cameras of a rig would stand where stale poses say, which nobody would notice.
#[test]
fn rigs_and_frames_say_where_cameras_are() {
    let place = Place::colmap();
    fs::write(place.path("sparse/0/rigs.txt"), "1 2 CAMERA 1 CAMERA 2 1 1 0 0 0 -0.25 0 0\n").unwrap();
    fs::write(place.path("sparse/0/frames.txt"), "1 1 1 0 0 0 -1 0 0 2 CAMERA 1 3 CAMERA 2 7\n").unwrap();
    let set = place.read(Images::Optional).unwrap();
    let positions: Vec<DVec3> = set.photos.iter().map(|photo| photo.camera.pose.position).collect();
    assert_eq!(positions, [DVec3::X, DVec3::new(1.25, 0.0, 0.0)]);
    assert!(
        set.notes.iter().any(|note| note.starts_with("1 of 2 images stand elsewhere by the rigs")),
        "{:?}",
        set.notes
    );
    // What is read as cameras, or cut down to some of them, is the same.
    let cameras = crate::files::io::read_cameras(place.0.path()).unwrap();
    assert_eq!(cameras[1].pose.position, positions[1]);
    let cut = colmap::subset(place.0.path(), &["sub/b.jpg".into()]).unwrap();
    let images = colmap::binary::images(Path::new("images.bin"), &cut.files[1].1).unwrap();
    assert_eq!(images[0].pose().unwrap().position, positions[1]);
}

/// If this failed, a capture that COLMAP could not join would be read as its first fragment.
#[test]
fn the_largest_of_several_models_is_read() {
    let place = Place::colmap();
    fs::write(place.path("sparse/0/images.txt"), "3 1 0 0 0 -1 0 0 1 a.jpg\n\n").unwrap();
    for (name, text) in [("cameras", CAMERAS), ("images", IMAGES), ("points3D", POINTS)] {
        fs::write(place.path(&format!("sparse/1/{name}.txt")), text).unwrap();
        fs::write(place.path(&format!("sparse/10/{name}.txt")), text).unwrap();
    }
    for path in ["", "sparse"] {
        let set = read(&place.path(path).join("."), &ReadOptions::default()).unwrap();
        assert_eq!(set.photos.len(), 2);
        let said = "holds 3 models: 1 is read, of 2 images; 10 has 2";
        assert!(set.notes.iter().any(|note| note.contains(said)), "{:?}", set.notes);
    }
    assert_eq!(read(&place.path("sparse/0"), &ReadOptions::default()).unwrap().photos.len(), 1);
}

/// If this failed, mistaken poses would be noticed only by empty renders.
#[test]
fn cameras_that_look_away_are_refused() {
    let place = Place::colmap();
    let turned = IMAGES.replace(" 1 0 0 0 ", " 0 1 0 0 ");
    fs::write(place.path("sparse/0/images.txt"), turned).unwrap();
    let message = place.refusal(Images::Optional);
    assert!(
        message.contains("look away from the points") && message.contains("OpenGL (Y up, -Z forward)"),
        "{message}"
    );
}

/// The matrix of a camera at (x, 0, 4) that looks along -z in OpenGL axes.
fn frame(name: &str, x: u32, more: &str) -> String {
    format!(
        r#"{{"file_path": "{name}", "transform_matrix": [[1, 0, 0, {x}], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]{more}}}"#
    )
}

/// If this failed, masks that were saved as JPEG would be left out without a word, and backgrounds be trained.
#[test]
fn masks_may_be_of_any_image_format() {
    for mask in ["masks/a.jpg", "masks/a.JPG", "mask/a.jpeg", "masks/a.jpg.jpg"] {
        let place = Place::colmap();
        place.image("images/a.jpg", 40, 20);
        place.image("images/sub/b.jpg", 40, 20);
        place.image(mask, 40, 20);
        let set = place.read(Images::Needed).unwrap();
        assert!(
            set.photos[0].mask.as_ref().is_some_and(|path| path.ends_with(mask)),
            "{mask}: {:?}",
            set.photos[0].mask
        );
        assert_eq!(set.photos[1].mask, None);
    }
}

/// If this failed, what nerfstudio writes beside the poses would be lost: masks, seed points, lenses by frame.
#[test]
fn a_nerfstudio_folder() {
    let frames =
        [frame("images/b.png", 0, r#", "mask_path": "m/b.png", "fl_x": 60, "k4": 0.25"#), frame("images/a.png", 1, "")];
    let text = format!(
        r#"{{"fl_x": 30, "fl_y": 31, "w": 40, "h": 20, "k1": 0.5, "p1": 0.125, "camera_model": "OPENCV",
            "ply_file_path": "seed.ply", "frames": [{}]}}"#,
        frames.join(", ")
    );
    let ply =
        "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let place = Place::new(&[("transforms.json", &text), ("seed.ply", &format!("{ply}0 0 0\n1 0 0\n"))]);
    place.image("images/a.png", 40, 20);
    place.image("images/b.png", 40, 20);
    place.image("m/b.png", 40, 20);
    place.image("masks/a.png.png", 40, 20);
    let set = place.read(Images::Needed).unwrap();
    let [a, b] = &set.photos[..] else { panic!("{} photos", set.photos.len()) };
    assert_eq!((a.camera.intrinsics.focal, b.camera.intrinsics.focal), ([30.0, 31.0], [60.0, 60.0]));
    assert_eq!((a.distortion.radial[0], a.distortion.tangential[0]), (0.5, 0.125));
    assert_eq!((b.distortion.radial[0], b.distortion.radial[3]), (0.0, 0.25));
    assert_eq!((file(&a.mask), file(&b.mask)), ("a.png.png".into(), "b.png".into()));
    assert_eq!((set.points.positions.len(), set.tracks.len()), (2, 0));
    fs::remove_file(place.path("m/b.png")).unwrap();
    assert!(place.refusal(Images::Needed).contains("m/b.png"));
    let fisheye = text.replace("\"OPENCV\"", "\"OPENCV_FISHEYE\"");
    fs::write(place.path("transforms.json"), fisheye).unwrap();
    let set = place.read(Images::Optional).unwrap();
    assert!(set.photos[0].distortion.fisheye && set.photos[0].distortion.tangential == [0.0; 2]);
}

/// If this failed, cameras without poses would be read as something, or a test split be trained on.
#[test]
fn blender_folders_read_the_training_split() {
    let split = |name: &str| format!(r#"{{"camera_angle_x": 0.7, "frames": [{}]}}"#, frame(name, 0, ""));
    let place =
        Place::new(&[("transforms_train.json", &split("./train/r_0")), ("transforms_test.json", &split("./test/r_0"))]);
    place.image("train/r_0.png", 8, 8);
    place.image("test/r_0.png", 8, 8);
    let set = place.read(Images::Needed).unwrap();
    assert_eq!(set.photos[0].camera.name, "train/r_0.png");
    assert!(set.notes.iter().any(|note| note.contains("only transforms_train.json is read")), "{:?}", set.notes);
    let poseless = r#"{"camera_angle_x": 0.7, "w": 8, "h": 8, "frames": [{"file_path": "a"}]}"#;
    fs::write(place.path("transforms_train.json"), poseless).unwrap();
    assert!(place.refusal(Images::Optional).contains("frame 0 (\"a\"): it has no transform_matrix"));
}

/// If this failed, NSVF's folders would be read with inverted poses, or with views that are meant for tests.
#[test]
fn an_nsvf_folder() {
    let pose = "1 0 0 3\n0 1 0 2\n0 0 1 1\n0 0 0 1\n";
    let place = Place::new(&[
        ("intrinsics.txt", "30 20 10 0\n0 0 0\n0\n1\n20 40\n"),
        ("bbox.txt", "-1 -1 -1 1 1 1 0.1\n"),
        ("pose/0_a.txt", pose),
        ("pose/0_b.txt", &pose.replace('3', "4")),
        ("pose/2_c.txt", pose),
    ]);
    place.image("rgb/0_a.png", 20, 10);
    place.image("rgb/0_b.png", 20, 10);
    place.image("rgb/0_z.png", 20, 10);
    let set = place.read(Images::Needed).unwrap();
    let camera = &set.photos[1].camera;
    assert_eq!((set.photos.len(), camera.name.as_str()), (2, "0_b.png"));
    assert_eq!((camera.pose.position, camera.pose.forward()), (DVec3::new(4.0, 2.0, 1.0), DVec3::Z));
    assert_eq!((camera.intrinsics.width, camera.intrinsics.focal), (20, [15.0; 2]));
    for fragment in ["only the 2 views for training (0_) of 3", "no pose: 0_z.png", "from [-1, -1, -1]"] {
        assert!(set.notes.iter().any(|note| note.contains(fragment)), "{fragment:?} is not in {:?}", set.notes);
    }
    assert_eq!(crate::files::io::read_cameras(place.0.path()).unwrap(), set.cameras());
    fs::write(place.path("pose/0_a.txt"), "1 0 0\n").unwrap();
    let set = place.read(Images::Optional).unwrap();
    let said = |note: &String| {
        note.starts_with("views left out: 1;") && note.contains("0_a.txt: the matrix must have the rows")
    };
    assert!(set.photos.len() == 1 && set.notes.iter().any(said), "{:?}", set.notes);
}

/// If this failed, the images beside a trajectory would be paired with the wrong poses, or with a part of them.
#[test]
fn a_trajectory_takes_the_images_beside_it() {
    let view = |i: u32| format!("{i} {i} 0\n1 0 0 {i}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    let place = Place::new(&[("a.log", &(view(0) + &view(1)))]);
    place.image("images/000002.jpg", 40, 20);
    let read_log = || read(&place.path("a.log"), &ReadOptions::default()).unwrap();
    let set = read_log();
    assert!(set.notes.iter().any(|note| note.contains("1 images lie beside 2 poses")), "{:?}", set.notes);
    assert_eq!(set.photos[1].image, None);
    place.image("images/000001.jpg", 40, 20);
    let set = read_log();
    assert_eq!((file(&set.photos[1].image), set.photos[1].camera.intrinsics.focal), ("000002.jpg".into(), [28.0; 2]));
    assert_eq!(set.photos[1].camera.pose.position, DVec3::X);
}
