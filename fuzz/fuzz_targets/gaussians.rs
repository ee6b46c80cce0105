#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::ply::gaussians(Path::new("no-such-folder/fuzz.ply"), bytes, &mut Vec::new());
});
