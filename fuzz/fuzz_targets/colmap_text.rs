#![no_main]

use camsplat::files::io::colmap::{self, text};
use camsplat::files::io::left_out::LeftOut;

// One input is all files, so that references between them are tried as well.
libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut files = bytes.split(|&b| b == 0xff);
    let mut next = || files.next().unwrap_or_default();
    let left_out = &mut LeftOut::default();
    let lenses = text::cameras(next(), left_out);
    let images = colmap::usable(&lenses, text::observed(next(), |_| true, left_out), left_out);
    let _ = colmap::cameras_of(&lenses, &images);
    let _ = colmap::surface_points(&text::points(next(), left_out), &images);
    let _ = (text::rigs(next(), left_out), text::frames(next(), left_out));
});
