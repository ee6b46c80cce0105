#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::photos::trajectory::parse(Path::new("fuzz.log"), bytes);
});
