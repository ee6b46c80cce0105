#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::colmap::binary::rigs(Path::new("rigs.bin"), bytes);
    let _ = camsplat::files::io::colmap::binary::frames(Path::new("frames.bin"), bytes);
});
