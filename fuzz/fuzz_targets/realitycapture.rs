#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::photos::realitycapture::parse(Path::new("cameras.csv"), bytes, &mut Vec::new());
});
