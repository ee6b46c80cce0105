#![no_main]

use std::path::Path;

use camsplat::files::io::splats;

// What a file begins with says its format; only `.splat` goes by its name.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    for name in ["no-such-folder/fuzz.gltf", "no-such-folder/fuzz.splat"] {
        let _ = splats::parse(Path::new(name), bytes, &mut Vec::new());
    }
});
