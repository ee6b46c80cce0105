//! What goes wrong, for C: a code and a line.

use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::{Error, Result};

/// How a call ended. Later versions may have further codes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CamsplatResult {
    /// It did what it should.
    Ok = 0,
    /// The request makes no sense, or an argument is null or was not initialised: the caller can mend it.
    Invalid = 1,
    /// No Vulkan device can be used, or not the one named or lent.
    NoDevice = 2,
    /// The plan does not fit the device's memory.
    OutOfMemory = 3,
    /// The device was lost. Close it and, where the application lent it, make another.
    DeviceLost = 4,
    /// The device has not finished a submission within the limit. What runs on it may still run: what it uses stays allocated, also after
    /// `camsplat_device_close`. Wait for a device that the application lent (`vkDeviceWaitIdle`, under its lock) before it is destroyed.
    Unfinished = 5,
    /// A Vulkan call failed in another way.
    Vulkan = 6,
    /// The application ended it: `lock` returned 0.
    Interrupted = 7,
    /// A fault of the library's own; please report it.
    Internal = 8,
}

/// Why a call failed. Whoever receives one frees it with `camsplat_error_free`.
pub struct CamsplatError {
    line: CString,
}

/// One line of UTF-8 that says what was wrong, where, and what to do. It lives as long as `error`; of null it is empty.
///
/// Threads: any, until `error` is freed.
///
/// # Safety
/// `error` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_error_message(error: *const CamsplatError) -> *const c_char {
    // SAFETY: as the caller guarantees.
    unsafe { error.as_ref() }.map_or(c"".as_ptr(), |error| error.line.as_ptr())
}

/// Frees an error; null is let be.
///
/// Threads: any, once.
///
/// # Safety
/// `error` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_error_free(error: *mut CamsplatError) {
    // SAFETY: as the caller guarantees.
    unsafe { free(error) };
}

fn code(error: &Error) -> CamsplatResult {
    match error {
        Error::NoDevice(_) => CamsplatResult::NoDevice,
        Error::OutOfMemory { .. } => CamsplatResult::OutOfMemory,
        Error::DeviceLost { .. } => CamsplatResult::DeviceLost,
        Error::Unfinished { .. } => CamsplatResult::Unfinished,
        Error::Vulkan { .. } => CamsplatResult::Vulkan,
        Error::Interrupted => CamsplatResult::Interrupted,
        Error::Input { .. } | Error::NotEmpty { .. } | Error::Request(_) | Error::Io { .. } => CamsplatResult::Invalid,
    }
}

/// Runs what C asked for. Where it fails, `error`, unless it is null, receives why; else null.
///
/// # Safety
/// `error` is null or points at a pointer that may be written.
pub(super) unsafe fn answer(error: *mut *mut CamsplatError, run: impl FnOnce() -> Result<()>) -> CamsplatResult {
    let (code, line) = match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(())) => (CamsplatResult::Ok, None),
        Ok(Err(error)) => (code(&error), Some(error.to_string())),
        Err(_) => {
            (CamsplatResult::Internal, Some("camsplat failed in a way that it should not; please report it".into()))
        }
    };
    let made = |line: String| {
        let line = CString::new(line.replace('\0', " ")).unwrap_or_default();
        Box::into_raw(Box::new(CamsplatError { line }))
    };
    if !error.is_null() {
        // SAFETY: as the caller guarantees; nothing may have been written there yet.
        unsafe { error.write(line.map_or(std::ptr::null_mut(), made)) };
    }
    code
}

/// As [`answer`], of what makes something for C to own: `place` receives it, or null where it fails.
///
/// # Safety
/// As for [`answer`]; `place` is null or points at a pointer that may be written.
pub(super) unsafe fn answer_with<T>(
    place: *mut *mut T,
    error: *mut *mut CamsplatError,
    make: impl FnOnce() -> Result<T>,
) -> CamsplatResult {
    let run = || {
        if place.is_null() {
            return Err(Error::request("the place for the result is null"));
        }
        // SAFETY: as the caller guarantees; nothing may have been written there yet.
        unsafe { place.write(std::ptr::null_mut()) };
        let made = Box::into_raw(Box::new(make()?));
        // SAFETY: as above.
        unsafe { place.write(made) };
        Ok(())
    };
    // SAFETY: as the caller guarantees.
    unsafe { answer(error, run) }
}

/// What `object` points at.
///
/// # Errors
/// Where it is null; `name` is the argument's.
///
/// # Safety
/// `object` is null or valid for as long as the result is used.
pub(super) unsafe fn given<'a, T>(object: *const T, name: &str) -> Result<&'a T> {
    // SAFETY: as the caller guarantees.
    unsafe { object.as_ref() }.ok_or_else(|| Error::request(format!("`{name}` is null")))
}

/// Frees what [`answer_with`] made.
///
/// # Safety
/// `made` is null or from there, and not freed yet.
pub(super) unsafe fn free<T>(made: *mut T) {
    if !made.is_null() {
        // SAFETY: as the caller guarantees. A panic on the way must not reach C, and leaves nothing to do.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(unsafe { Box::from_raw(made) })));
    }
}
