//! RenderDoc captures through its in-application API. In headless compute a capture tool never sees a frame, so the capture is
//! started and ended explicitly.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::path::{Path, PathBuf};

use crate::{Error, Result};

/// Where RenderDoc's library is: loaded already or on the system's path, or where its packages put it.
const LIBRARIES: &[&str] = if cfg!(windows) {
    &["renderdoc.dll", r"C:\Program Files\RenderDoc\renderdoc.dll"]
} else {
    &[
        "librenderdoc.so",
        "/usr/lib/x86_64-linux-gnu/renderdoc/librenderdoc.so",
        "/usr/lib/renderdoc/librenderdoc.so",
        "/usr/lib64/renderdoc/librenderdoc.so",
    ]
};

/// The first entries of RenderDoc's function table of API version 1.0.0; later versions only append to it.
#[repr(C)]
struct Table {
    get_api_version: *const c_void,
    set_capture_option_u32: *const c_void,
    set_capture_option_f32: *const c_void,
    get_capture_option_u32: *const c_void,
    get_capture_option_f32: *const c_void,
    set_focus_toggle_keys: *const c_void,
    set_capture_keys: *const c_void,
    get_overlay_bits: *const c_void,
    mask_overlay_bits: *const c_void,
    remove_hooks: *const c_void,
    unload_crash_handler: *const c_void,
    set_capture_file_path_template: unsafe extern "C" fn(*const c_char),
    get_capture_file_path_template: *const c_void,
    get_num_captures: unsafe extern "C" fn() -> u32,
    get_capture: unsafe extern "C" fn(u32, *mut c_char, *mut u32, *mut u64) -> u32,
    trigger_capture: *const c_void,
    is_target_control_connected: *const c_void,
    launch_replay_ui: *const c_void,
    set_active_window: *const c_void,
    start_frame_capture: unsafe extern "C" fn(*mut c_void, *mut c_void),
    is_frame_capturing: *const c_void,
    end_frame_capture: unsafe extern "C" fn(*mut c_void, *mut c_void) -> u32,
}

/// RenderDoc, loaded into this process.
pub struct RenderDoc {
    table: &'static Table,
}

impl RenderDoc {
    /// Loads RenderDoc. It must come before the context that is to be captured, which is made with [`ContextOptions::capture`](super::ContextOptions::capture).
    ///
    /// # Errors
    /// Where RenderDoc is not installed.
    pub fn load() -> Result<Self> {
        // SAFETY: the library is RenderDoc's, its entry point has this signature, and it is never unloaded, so that the table it hands out
        // stays valid.
        unsafe {
            let library = LIBRARIES.iter().find_map(|name| libloading::Library::new(*name).ok()).ok_or_else(|| {
                let name = LIBRARIES[0];
                Error::NoDevice(format!(
                    "RenderDoc is not installed ({name}): install renderdoc, or leave out `renderdoc`"
                ))
            })?;
            let library = Box::leak(Box::new(library));
            let get_api: libloading::Symbol<unsafe extern "C" fn(c_int, *mut *mut c_void) -> c_int> = library
                .get(b"RENDERDOC_GetAPI\0")
                .map_err(|e| Error::NoDevice(format!("RenderDoc has no in-application API: {e}")))?;
            let mut table = std::ptr::null_mut();
            if get_api(10_000, &mut table) != 1 || table.is_null() {
                return Err(Error::NoDevice("RenderDoc refused its in-application API 1.0.0".into()));
            }
            Ok(Self { table: &*table.cast::<Table>() })
        }
    }

    /// Starts a capture whose file name starts with `template`.
    ///
    /// # Errors
    /// Where the path cannot be passed to RenderDoc.
    pub fn start(&self, template: &Path) -> Result<()> {
        let template = CString::new(template.to_string_lossy().as_bytes())
            .map_err(|_| Error::input(template, "a capture's path holds no NUL"))?;
        // SAFETY: the table is valid for the life of the process; null means the only device and no window.
        unsafe {
            (self.table.set_capture_file_path_template)(template.as_ptr());
            (self.table.start_frame_capture)(std::ptr::null_mut(), std::ptr::null_mut());
        }
        Ok(())
    }

    /// Ends the capture and returns its path.
    ///
    /// # Errors
    /// Where RenderDoc could not write it.
    pub fn end(&self) -> Result<PathBuf> {
        let failed = || {
            Error::NoDevice(
                "RenderDoc could not take the capture: see that its Vulkan layer is registered (renderdoccmd vulkanlayer \
                 `explain`) and that the file can be written"
                    .into(),
            )
        };
        let mut path = [0 as c_char; 4096];
        let mut length = path.len() as u32;
        // SAFETY: as in `start`; `path` has the length `length`.
        unsafe {
            if (self.table.end_frame_capture)(std::ptr::null_mut(), std::ptr::null_mut()) != 1 {
                return Err(failed());
            }
            let last = (self.table.get_num_captures)().checked_sub(1).ok_or_else(failed)?;
            if (self.table.get_capture)(last, path.as_mut_ptr(), &mut length, std::ptr::null_mut()) != 1 {
                return Err(failed());
            }
            Ok(PathBuf::from(CStr::from_ptr(path.as_ptr()).to_string_lossy().into_owned()))
        }
    }
}
