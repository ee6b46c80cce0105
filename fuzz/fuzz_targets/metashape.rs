#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::photos::metashape::parse(Path::new("cameras.xml"), bytes, &mut Vec::new());
});
