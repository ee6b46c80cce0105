#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::stl::parse(Path::new("no-such-folder/fuzz.stl"), bytes, &mut Vec::new());
});
