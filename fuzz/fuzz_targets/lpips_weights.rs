#![no_main]

use std::path::Path;

use camsplat::splats::image_metrics::{Network, Weights};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = Weights::parse(Path::new("fuzz.safetensors"), bytes, Network::Alex);
});
