#![no_main]

use std::path::Path;

use camsplat::files::io::transforms;
use camsplat::files::photos::Photo;
use glam::{DVec2, DVec3};

// The folder does not exist, so that no input can name a file beside it. Lenses that a file may name are used as well.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Ok(read) = transforms::photos(Path::new("no-such-folder/fuzz.json"), bytes, false, &mut Vec::new()) {
        for photo in read.photos.iter().take(4) {
            let lens = photo.lens();
            let _ = lens.project(DVec3::new(0.3, -0.2, 1.0));
            let _ = lens.unproject(DVec2::new(1.0, 2.0));
        }
        let photos: Vec<&Photo> = read.photos.iter().collect();
        let _ = transforms::write_photos(&photos, None);
    }
});
