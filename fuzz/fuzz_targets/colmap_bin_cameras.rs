#![no_main]

use std::path::Path;

use camsplat::files::io::left_out::LeftOut;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::colmap::binary::cameras(Path::new("cameras.bin"), bytes, &mut LeftOut::default());
});
