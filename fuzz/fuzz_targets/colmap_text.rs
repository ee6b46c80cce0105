#![no_main]

use std::collections::HashMap;
use std::path::Path;

use camsplat::files::io::colmap::{self, text};

// One input is all three files, so that references between them are tried as well.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut files = bytes.split(|&b| b == 0xff);
    let mut next = || files.next().unwrap_or_default();
    let path = Path::new("model.txt");
    let cameras = text::cameras(path, next());
    let images = text::images(path, next()).unwrap_or_default();
    let centres: HashMap<_, _> = images.iter().map(|image| (image.id, image.pose.position)).collect();
    if let Ok(cameras) = cameras {
        let _ = colmap::join(path, &cameras, images, &mut Vec::new());
    }
    if let Ok(points) = text::points(path, next()) {
        let _ = colmap::points_surface(path, &points, &centres);
    }
});
