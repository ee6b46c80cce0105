#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::depth_maps::depths(Path::new("a.npy"), bytes);
    let _ = camsplat::files::io::depth_maps::confidence(Path::new("a.npy"), bytes);
});
