#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::environment::parse_environment(Path::new("fuzz.hdr"), bytes, &mut Vec::new());
});
