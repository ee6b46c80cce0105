#![no_main]

use std::path::Path;

// The folder does not exist, so that no input can name a file beside it.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = camsplat::files::io::obj::parse(Path::new("no-such-folder/fuzz.obj"), bytes, &mut Vec::new());
});
