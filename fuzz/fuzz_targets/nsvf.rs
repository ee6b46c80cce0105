#![no_main]

use std::path::Path;

use camsplat::files::io::photos::nsvf;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = nsvf::pose(Path::new("pose.txt"), bytes);
    let _ = nsvf::intrinsics(Path::new("intrinsics.txt"), bytes);
});
