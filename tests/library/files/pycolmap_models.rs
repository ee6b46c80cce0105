//! Models that pycolmap 4 wrote (`pycolmap/make.py`), against what it knows of them.

use std::collections::BTreeMap;
use std::path::Path;

use camsplat::files::io::colmap::{self, binary};
use camsplat::files::io::photos::{ReadOptions, read};
use glam::{DVec2, DVec3};
use serde::Deserialize;

/// What is known of an image.
#[derive(Deserialize)]
struct Truth {
    centre: DVec3,
    /// Of [`POINTS`].
    pixels: [DVec2; 3],
}

const POINTS: [DVec3; 3] = [DVec3::new(0.1, 0.2, 1.0), DVec3::new(-0.3, 0.25, 1.0), DVec3::new(0.4, -0.1, 1.0)];

/// If this failed, a model of COLMAP 4 would be read with other poses than it has, or a lens bend otherwise than COLMAP's.
#[test]
fn poses_and_lenses_are_those_of_pycolmap() {
    let models = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/library/files/pycolmap");
    for (name, count) in [("lenses", 17), ("rig", 12)] {
        let folder = models.join(name);
        let truth: BTreeMap<String, Truth> =
            serde_json::from_slice(&std::fs::read(folder.join("truth.json")).unwrap()).unwrap();
        let set = read(&folder, &ReadOptions::default()).unwrap();
        assert_eq!((set.photos.len(), truth.len()), (count, count), "{:?}", set.notes);
        assert!(
            !set.notes.iter().any(|note| note.contains("left out") || note.contains("elsewhere")),
            "{:?}",
            set.notes
        );
        for photo in &set.photos {
            let known = &truth[&photo.camera.name];
            assert!(photo.camera.pose.position.distance(known.centre) < 1e-9, "{name} {}", photo.camera.name);
            for (point, pixel) in POINTS.iter().zip(known.pixels) {
                let found = photo.lens().project(*point).unwrap();
                assert!(found.distance(pixel) < 1e-9, "{name} {}: {found} for {pixel}", photo.camera.name);
            }
        }
    }
}

/// If this failed, stale poses in the list of images, which COLMAP does not read where there are rigs, would be taken for the right ones.
#[test]
fn rigs_win_over_stale_poses() {
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/library/files/pycolmap/rig");
    let folder = tempfile::tempdir().unwrap();
    for name in ["cameras.bin", "images.bin", "points3D.bin", "rigs.bin", "frames.bin"] {
        std::fs::copy(rig.join(name), folder.path().join(name)).unwrap();
    }
    let fresh = colmap::cameras(folder.path(), &mut Vec::new()).unwrap();
    let path = folder.path().join("images.bin");
    let mut bytes = std::fs::read(&path).unwrap();
    // The first translation follows the number of images, its own number and its rotation.
    bytes[8 + 4 + 32..8 + 4 + 40].copy_from_slice(&99.0f64.to_le_bytes());
    std::fs::write(&path, &bytes).unwrap();
    assert!(binary::images(&path, &bytes).unwrap()[0].stored.1[0] == 99.0);
    let mut notes = Vec::new();
    let read = colmap::cameras(folder.path(), &mut notes).unwrap();
    assert!(notes[0].starts_with("1 of 12 images stand elsewhere"), "{notes:?}");
    for (a, b) in fresh.iter().zip(&read) {
        assert!(a.pose.position.distance(b.pose.position) < 1e-12, "{}", a.name);
    }
}
