//! The library for C (`include/camsplat.h`, which cbindgen makes of this folder). Built by
//! `cargo rustc --release --lib --no-default-features --features capi --crate-type cdylib`.
//!
//! No function unwinds into C or ends the process on bad input: it answers a `CamsplatResult`, and where the caller gives a place for it,
//! a `CamsplatError` with a line that says what was wrong.

mod device;
mod failure;
mod plan;
mod versioned;

/// Version of this header: major, minor and patch.
pub const CAMSPLAT_VERSION_MAJOR: u32 = 0;
/// See `CAMSPLAT_VERSION_MAJOR`.
pub const CAMSPLAT_VERSION_MINOR: u32 = 1;
/// See `CAMSPLAT_VERSION_MAJOR`.
pub const CAMSPLAT_VERSION_PATCH: u32 = 0;

// The header is written by hand in this alone.
const _: () = assert!(matches!(
    (
        env!("CARGO_PKG_VERSION_MAJOR").as_bytes(),
        env!("CARGO_PKG_VERSION_MINOR").as_bytes(),
        env!("CARGO_PKG_VERSION_PATCH").as_bytes()
    ),
    (b"0", b"1", b"0")
));

/// Version of the library that is loaded. Programs that were compiled against an older header of the same major version run with it; for
/// major version 0, of the same minor version.
///
/// Threads: any, at any time.
///
/// # Safety
/// Each pointer is null or points at a number that may be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_version(major: *mut u32, minor: *mut u32, patch: *mut u32) {
    let parts = [(major, CAMSPLAT_VERSION_MAJOR), (minor, CAMSPLAT_VERSION_MINOR), (patch, CAMSPLAT_VERSION_PATCH)];
    for (place, value) in parts {
        // SAFETY: as the caller guarantees.
        if let Some(place) = unsafe { place.as_mut() } {
            *place = value;
        }
    }
}
