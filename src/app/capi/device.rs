//! Devices for C: those there are, one of the library's own, one that an application lends.

use std::ffi::{CStr, CString, c_char, c_void};
use std::mem::size_of;
use std::sync::Arc;
use std::time::Duration;

use ash::vk;

use super::failure::{CamsplatError, CamsplatResult, answer, answer_with, free, given};
use super::versioned::{Versioned, init, read, write};
use crate::engine::vulkan::host::{HostDevice, QueueLock, RawHost};
use crate::engine::vulkan::instance::Instance;
use crate::engine::vulkan::physical::Physical;
use crate::engine::vulkan::{Context, ContextOptions};
use crate::{Error, Result};

/// The Vulkan devices of this machine.
pub struct CamsplatDevices {
    all: Vec<Described>,
}

/// A Vulkan device that plans are made on. Several threads may plan on one device at once.
pub struct CamsplatDevice {
    pub(super) context: Arc<Context>,
    described: Described,
    notes: CString,
}

/// Strings of a device that C may hold on to.
struct Described {
    name: CString,
    driver: CString,
    kind: CString,
    lacks: CString,
    memory: u64,
}

/// What a device is. Strings live as long as the `CamsplatDevices` or `CamsplatDevice` that they were asked of.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CamsplatDeviceInfo {
    /// Set by `camsplat_device_info_init`.
    pub struct_size: usize,
    /// Name, as its driver gives it.
    pub name: *const c_char,
    /// Name and version of the driver.
    pub driver: *const c_char,
    /// "discrete GPU", "integrated GPU", "virtual GPU", "CPU" or "other".
    pub kind: *const c_char,
    /// What the library needs and the device does not have; empty where it can be used.
    pub lacks: *const c_char,
    /// Bytes of its memory.
    pub memory: u64,
}

/// Vulkan objects of the application's own, which `camsplat_host_init` sets to null. All stay the application's, and must outlive the
/// `CamsplatDevice` that is made with them.
///
/// A queue takes one submission at a time. While a function of this library runs with the device, either nothing else uses `queue`, or
/// the application gives `lock` and `unlock` and takes the same lock wherever it submits to the queue, presents, or waits for it or the
/// whole device. The library holds the lock for one `vkQueueSubmit` at a time, never while it waits.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CamsplatHost {
    /// Set by `camsplat_host_init`.
    pub struct_size: usize,
    /// The loader's `vkGetInstanceProcAddr`.
    pub get_instance_proc_addr: Option<unsafe extern "system" fn(*mut c_void, *const c_char) -> *mut c_void>,
    /// `VkInstance`, of Vulkan 1.2 or later.
    pub instance: *mut c_void,
    /// `VkPhysicalDevice`.
    pub physical_device: *mut c_void,
    /// `VkDevice`, made with `VK_KHR_push_descriptor`.
    pub device: *mut c_void,
    /// `VkQueue` that can compute.
    pub queue: *mut c_void,
    /// Its family.
    pub queue_family: u32,
    /// 1 where the device was made with `VK_EXT_memory_budget`: what fits is then decided by what is free.
    pub memory_budget: u32,
    /// Called before each submission with `lock_user`, on the thread that called this library; or null, together with `unlock`. It may wait
    /// for as long as the application likes. Where it returns 0 the queue is not used and `unlock` not called, and the call of this library
    /// ends with `CAMSPLAT_RESULT_INTERRUPTED`: so an application that is closed ends a plan at any time. It must return normally.
    pub lock: Option<unsafe extern "C" fn(lock_user: *mut c_void) -> u32>,
    /// Called after each submission, on the same thread.
    pub unlock: Option<unsafe extern "C" fn(lock_user: *mut c_void)>,
    /// What both are called with; usable from every thread that calls this library.
    pub lock_user: *mut c_void,
    /// How long a submission should take, in milliseconds; 0: 100 ms. Where it is given, the library submits one at a time and waits for its
    /// end before the next, so that what the application submits waits for no more than one. Lengths are learnt from one submission to the
    /// next; a stage that alone takes longer is not divided.
    pub submission_ms: f64,
    /// What names and labels in capture tools begin with ("camsplat/"), where the instance was made with `VK_EXT_debug_utils`; null: none are
    /// given.
    pub label_prefix: *const c_char,
    /// How long a submission may take before the call fails with `CAMSPLAT_RESULT_UNFINISHED`, in milliseconds, with what the application
    /// has on the queue before it; 0: a minute, and without end on CPU devices.
    pub wait_limit_ms: f64,
}

// SAFETY: all fields are integers, floats, pointers and functions that may be null; the size comes first.
unsafe impl Versioned for CamsplatDeviceInfo {
    const NAME: &'static str = "CamsplatDeviceInfo";
    const INIT: &'static str = "camsplat_device_info_init";
    const FIRST_SIZE: usize = size_of::<Self>();

    fn initial() -> Self {
        let [name, driver, kind, lacks] = [std::ptr::null(); 4];
        Self { struct_size: 0, name, driver, kind, lacks, memory: 0 }
    }
}

// SAFETY: as above.
unsafe impl Versioned for CamsplatHost {
    const NAME: &'static str = "CamsplatHost";
    const INIT: &'static str = "camsplat_host_init";
    const FIRST_SIZE: usize = size_of::<Self>();

    fn initial() -> Self {
        let [instance, physical_device, device, queue, lock_user] = [std::ptr::null_mut(); 5];
        Self {
            struct_size: 0,
            get_instance_proc_addr: None,
            instance,
            physical_device,
            device,
            queue,
            queue_family: 0,
            memory_budget: 0,
            lock: None,
            unlock: None,
            lock_user,
            submission_ms: 0.0,
            label_prefix: std::ptr::null(),
            wait_limit_ms: 0.0,
        }
    }
}

/// Initialises what `camsplat_devices_info` and `camsplat_device_info` fill in; `size` is `sizeof *info`.
///
/// Threads: any.
///
/// # Safety
/// `info` is null or points at `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_device_info_init(info: *mut CamsplatDeviceInfo, size: usize) {
    // SAFETY: as the caller guarantees.
    unsafe { init(info, size) };
}

/// Initialises what `camsplat_device_adopt` takes; `size` is `sizeof *host`.
///
/// Threads: any.
///
/// # Safety
/// `host` is null or points at `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_host_init(host: *mut CamsplatHost, size: usize) {
    // SAFETY: as the caller guarantees.
    unsafe { init(host, size) };
}

/// Lists the Vulkan devices of this machine, those that cannot be used too. `devices` receives the list, or null where this fails.
///
/// Threads: any.
///
/// # Safety
/// `devices` points at a pointer; `error` is null or points at one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_devices_list(
    devices: *mut *mut CamsplatDevices,
    error: *mut *mut CamsplatError,
) -> CamsplatResult {
    let list = || {
        let all = Physical::all(&Instance::new(false)?)?;
        Ok(CamsplatDevices { all: all.iter().map(Described::new).collect() })
    };
    // SAFETY: as the caller guarantees.
    unsafe { answer_with(devices, error, list) }
}

/// How many there are; 0 of null.
///
/// Threads: any, until `devices` is freed.
///
/// # Safety
/// `devices` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_devices_count(devices: *const CamsplatDevices) -> usize {
    // SAFETY: as the caller guarantees.
    unsafe { devices.as_ref() }.map_or(0, |devices| devices.all.len())
}

/// What the device at `index` is.
///
/// Threads: any, until `devices` is freed.
///
/// # Safety
/// `devices` is null or one of this library's that is not freed, `info` is null or was initialised, `error` is null or points at a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_devices_info(
    devices: *const CamsplatDevices,
    index: usize,
    info: *mut CamsplatDeviceInfo,
    error: *mut *mut CamsplatError,
) -> CamsplatResult {
    // SAFETY: as the caller guarantees.
    unsafe {
        answer(error, || {
            let all = &given(devices, "devices")?.all;
            let none = || Error::request(format!("`index` is {index}, and there are {} devices", all.len()));
            write(info, all.get(index).ok_or_else(none)?.info())
        })
    }
}

/// Frees a list; null is let be.
///
/// Threads: any, once no other function uses it.
///
/// # Safety
/// `devices` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_devices_free(devices: *mut CamsplatDevices) {
    // SAFETY: as the caller guarantees.
    unsafe { free(devices) };
}

/// Opens a Vulkan device: the best one where `name` is null or empty, else the one of that number in `camsplat_devices_list` ("1"), or the first
/// whose name holds `name`, in whatever case. `device` receives it, or null where this fails.
///
/// Threads: any.
///
/// # Safety
/// `name` is null or a string that ends in NUL, `device` points at a pointer, `error` is null or points at one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_device_open(
    name: *const c_char,
    device: *mut *mut CamsplatDevice,
    error: *mut *mut CamsplatError,
) -> CamsplatResult {
    // SAFETY: as the caller guarantees.
    unsafe {
        answer_with(device, error, || {
            let name = text(name).map(|name| name.to_string_lossy().into_owned()).filter(|name| !name.is_empty());
            Ok(CamsplatDevice::new(Context::new(&ContextOptions { device: name, ..ContextOptions::default() })?))
        })
    }
}

/// Uses a Vulkan device of the application's own. `device` receives it, or null where this fails. Adopt a queue once: two
/// `CamsplatDevice`s on one queue know of each other by `lock` alone.
///
/// Threads: any; `host` itself is not needed once this returns.
///
/// # Safety
/// `host` is null or was initialised, and its handles are valid and belong together; `device` points at a pointer, `error` is null or
/// points at one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_device_adopt(
    host: *const CamsplatHost,
    device: *mut *mut CamsplatDevice,
    error: *mut *mut CamsplatError,
) -> CamsplatResult {
    // SAFETY: as the caller guarantees.
    unsafe { answer_with(device, error, || Ok(CamsplatDevice::new(adopt(&read(host)?)?))) }
}

/// What the device is.
///
/// Threads: any, until `device` is closed.
///
/// # Safety
/// `device` is null or one of this library's that is not closed, `info` is null or was initialised, `error` is null or points at a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_device_info(
    device: *const CamsplatDevice,
    info: *mut CamsplatDeviceInfo,
    error: *mut *mut CamsplatError,
) -> CamsplatResult {
    // SAFETY: as the caller guarantees.
    unsafe { answer(error, || write(info, given(device, "device")?.described.info())) }
}

/// What a user should know of the choice of the device: which GPU was passed over and for what, and whether there is none. Lines with
/// newlines between them, empty where there is nothing to say; they live as long as `device`.
///
/// Threads: any, until `device` is closed.
///
/// # Safety
/// `device` is null or one of this library's that is not closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_device_notes(device: *const CamsplatDevice) -> *const c_char {
    // SAFETY: as the caller guarantees.
    unsafe { device.as_ref() }.map_or(c"".as_ptr(), |device| device.notes.as_ptr())
}

/// Closes a device; null is let be. Plans that were made on it stay. What the application lent is not destroyed.
///
/// Threads: any, once no other function uses it.
///
/// # Safety
/// `device` is null or one of this library's that is not closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_device_close(device: *mut CamsplatDevice) {
    // SAFETY: as the caller guarantees.
    unsafe { free(device) };
}

impl CamsplatDevice {
    fn new(context: Arc<Context>) -> Self {
        let (described, notes) = (Described::new(context.physical()), string(&context.notes().join("\n")));
        Self { context, described, notes }
    }
}

impl Described {
    fn new(physical: &Physical) -> Self {
        let Physical { name, driver, kind, lacks, heap, .. } = physical;
        let [name, driver, kind, lacks] = [name, driver, &kind.to_string(), &lacks.join(", ")].map(|text| string(text));
        Self { name, driver, kind, lacks, memory: *heap }
    }

    fn info(&self) -> CamsplatDeviceInfo {
        let [name, driver, kind, lacks] = [&self.name, &self.driver, &self.kind, &self.lacks].map(|text| text.as_ptr());
        CamsplatDeviceInfo { struct_size: 0, name, driver, kind, lacks, memory: self.memory }
    }
}

fn string(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// A string of C's.
///
/// # Safety
/// `text` is null or ends in NUL, and is valid for as long as the result is used.
unsafe fn text<'a>(text: *const c_char) -> Option<&'a CStr> {
    // SAFETY: as the caller guarantees.
    (!text.is_null()).then(|| unsafe { CStr::from_ptr(text) })
}

/// The lock of an application.
struct Callbacks {
    lock: unsafe extern "C" fn(*mut c_void) -> u32,
    unlock: unsafe extern "C" fn(*mut c_void),
    user: *mut c_void,
}

// SAFETY: the application guarantees that both may be called with `user` from every thread that calls this library.
unsafe impl Send for Callbacks {}
// SAFETY: as above.
unsafe impl Sync for Callbacks {}

impl QueueLock for Callbacks {
    fn locked(&self, submit: &mut dyn FnMut()) {
        // SAFETY: as the application guarantees with `CamsplatHost`.
        if unsafe { (self.lock)(self.user) } == 0 {
            return;
        }
        submit();
        // SAFETY: as above.
        unsafe { (self.unlock)(self.user) };
    }
}

/// # Safety
/// The handles are valid and belong together.
unsafe fn adopt(host: &CamsplatHost) -> Result<Arc<Context>> {
    let handles = [host.instance, host.physical_device, host.device, host.queue];
    let (Some(load), false) = (host.get_instance_proc_addr, handles.contains(&std::ptr::null_mut())) else {
        return Err(Error::request("the CamsplatHost has a null in it; give every handle and vkGetInstanceProcAddr"));
    };
    let ms = host.submission_ms;
    if !(ms == 0.0 || (0.1..=1000.0).contains(&ms)) {
        return Err(Error::request(format!("`submission_ms` is {ms}; give 0, or 0.1 to 1000")));
    }
    let limit = host.wait_limit_ms;
    if !(limit == 0.0 || (1.0..=1e9).contains(&limit)) {
        return Err(Error::request(format!("`wait_limit_ms` is {limit}; give 0, or 1 to 1e9")));
    }
    let callbacks = match (host.lock, host.unlock) {
        (Some(lock), Some(unlock)) => Some(Callbacks { lock, unlock, user: host.lock_user }),
        (None, None) => None,
        _ => return Err(Error::request("of `lock` and `unlock` one is null; give both, or none")),
    };
    if host.memory_budget > 1 {
        return Err(Error::request(format!("`memory_budget` is {}; give 0 or 1", host.memory_budget)));
    }
    let [instance, physical, device, queue] = handles.map(|handle| handle as u64);
    // SAFETY: both are vkGetInstanceProcAddr, whose dispatchable handle is a pointer and whose result a function or null. The
    // handles are as the caller guarantees, and so is the prefix.
    unsafe {
        let get_instance_proc_addr = std::mem::transmute::<
            unsafe extern "system" fn(*mut c_void, *const c_char) -> *mut c_void,
            vk::PFN_vkGetInstanceProcAddr,
        >(load);
        let queue_family = host.queue_family;
        let raw = RawHost { get_instance_proc_addr, instance, physical, device, queue, queue_family };
        let mut lent = HostDevice::from_raw(raw);
        if let Some(callbacks) = callbacks {
            lent.queue_lock = Arc::new(callbacks);
        }
        if let Some(prefix) = text(host.label_prefix) {
            (lent.debug_utils, lent.prefix) = (true, prefix.to_string_lossy().into_owned());
        }
        lent.memory_budget = host.memory_budget != 0;
        lent.wait_limit = (limit > 0.0).then(|| Duration::from_secs_f64(limit / 1e3));
        lent.submission_time = (ms > 0.0).then(|| Duration::from_secs_f64(ms / 1e3));
        Context::adopt(lent)
    }
}
