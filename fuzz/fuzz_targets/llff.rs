#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::photos::llff::rows(Path::new("poses_bounds.npy"), bytes);
});
