//! The folder of others' photos and scenes, which is not part of the repository. Tests of it are ignored, and counted so, unless they are
//! asked for: `CAMSPLAT_DATA=FOLDER cargo test --release --tests -- --ignored`.

use std::path::PathBuf;

/// The folder that CAMSPLAT_DATA names.
pub fn data_folder() -> PathBuf {
    PathBuf::from(std::env::var_os("CAMSPLAT_DATA").expect("CAMSPLAT_DATA names the folder of data"))
}
