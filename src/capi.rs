//! The library for C (`include/camsplat.h`, which cbindgen makes of this file). Built by
//! `cargo rustc --release --lib --no-default-features --features capi --crate-type cdylib`.
//!
//! Every function may be called from any thread, and none unwinds into C: what goes wrong is a null pointer, and
//! [`camsplat_error`] says what it was.

use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use ash::vk;
use glam::{DQuat, DVec3};

use crate::plan::job::Plan;
use crate::plan::request::plan;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::region::Shape;
use crate::scene::surface::{Mesh, Points, Surface};
use crate::vulkan::host::{HostDevice, RawHost};
use crate::vulkan::{Context, Options};
use crate::{Error, Result};

/// A Vulkan device that plans are made on. Every function of this library may be called from any thread, none throws or aborts on bad
/// input; a device must not be closed while a plan is being made on it.
pub struct CamsplatDevice {
    context: Arc<Context>,
}

/// A finished plan.
pub struct CamsplatPlan {
    plan: Plan,
}

/// Vulkan objects of the application's own. All stay the application's, and must outlive the `CamsplatDevice` that is made with them.
/// While a function of this library runs with that device, nothing else may use `queue`: submit to it, present, or wait for it or the
/// whole device. Adopt a queue once, since two `CamsplatDevice`s on one queue do not know of each other.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CamsplatHost {
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
}

/// A camera: right-handed, world from camera, axes of the camera as in OpenCV (X right, Y down, Z forward).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CamsplatCamera {
    /// Position, in the surface's frame and units.
    pub position: [f64; 3],
    /// Rotation: a unit quaternion, w first.
    pub rotation: [f64; 4],
    /// Width of the image in pixels.
    pub width: u32,
    /// Height of the image in pixels.
    pub height: u32,
    /// Focal lengths in pixels, x and y.
    pub focal: [f64; 2],
    /// Principal point in pixels, x and y; the corner of the image is (0, 0).
    pub principal: [f64; 2],
}

/// What is to be planned; `camsplat_request` fills in all but the surface.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CamsplatRequest {
    /// Vertices, or points: x, y and z each.
    pub positions: *const f64,
    /// How many there are.
    pub position_count: usize,
    /// Triangles: three indices of vertices each, counter-clockwise from outside; null where the surface is points.
    pub triangles: *const u32,
    /// How many triangles there are.
    pub triangle_count: usize,
    /// Cameras to plan.
    pub views: u32,
    /// Whether the cameras are inside a room, not around an object.
    pub room: bool,
    /// Which way is up.
    pub up: [f64; 3],
    /// The lower corner of the cameras' box; NaN: derived from the surface.
    pub box_min: [f64; 3],
    /// The upper corner.
    pub box_max: [f64; 3],
    /// Cameras and viewers stay above this height along up; NaN: no floor.
    pub floor: f64,
    /// Minimum distance between cameras and the surface; NaN: derived from the surface.
    pub clearance: f64,
    /// Width of the cameras' images in pixels.
    pub width: u32,
    /// Height of the cameras' images in pixels.
    pub height: u32,
    /// Their horizontal field of view in degrees.
    pub fov_degrees: f64,
    /// Cameras that exist already: they count, and never move.
    pub kept: *const CamsplatCamera,
    /// How many of these there are.
    pub kept_count: usize,
    /// Another seed gives another plan; the same seed the same one on the same device and driver.
    pub seed: u64,
    /// Iterations; 0: the default for objects or rooms.
    pub iterations: u32,
    /// Called now and then, on the thread of `camsplat_plan`, with `user`, the iterations done and their total; or null. Returning false
    /// ends the plan early with what there is by then. It must return normally (no exception, no longjmp), and must not close the device.
    pub progress: Option<extern "C" fn(user: *mut c_void, done: u32, all: u32) -> bool>,
    /// What `progress` is called with.
    pub user: *mut c_void,
}

thread_local! {
    static FAILURE: RefCell<CString> = RefCell::default();
}

/// What went wrong in the last call of this thread that failed: one line of UTF-8, valid until the next call that fails.
#[unsafe(no_mangle)]
pub extern "C" fn camsplat_error() -> *const c_char {
    FAILURE.with_borrow(|failure| failure.as_ptr())
}

/// Opens the best Vulkan device there is, or the one whose name holds `name`; null where that fails.
///
/// # Safety
/// `name` is null or a string that ends in NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_open(name: *const c_char) -> *mut CamsplatDevice {
    boxed(|| {
        // SAFETY: as the caller guarantees.
        let name = (!name.is_null()).then(|| unsafe { CStr::from_ptr(name) });
        let device = name.map(|name| name.to_string_lossy().into_owned());
        let context = Context::new(&Options { device, ..Options::default() })?;
        Ok(CamsplatDevice { context })
    })
}

/// Uses a Vulkan device of the application's own; null where that fails.
///
/// # Safety
/// `host` points at one, whose handles are valid and belong together.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_adopt(host: *const CamsplatHost) -> *mut CamsplatDevice {
    boxed(|| {
        // SAFETY: as the caller guarantees.
        let host = unsafe { host.as_ref() }.ok_or_else(|| Error::request("`host` is null"))?;
        let handles = [host.instance, host.physical_device, host.device, host.queue];
        let (Some(load), false) = (host.get_instance_proc_addr, handles.contains(&std::ptr::null_mut())) else {
            return Err(Error::request("`host` has a null in it; give every handle and vkGetInstanceProcAddr"));
        };
        let [instance, physical, device, queue] = handles.map(|handle| handle as u64);
        // SAFETY: both are vkGetInstanceProcAddr, whose dispatchable handle is a pointer and whose result a function or null. The
        // handles are as the caller guarantees.
        let context = unsafe {
            let get_instance_proc_addr = std::mem::transmute::<
                unsafe extern "system" fn(*mut c_void, *const c_char) -> *mut c_void,
                vk::PFN_vkGetInstanceProcAddr,
            >(load);
            let queue_family = host.queue_family;
            let raw = RawHost { get_instance_proc_addr, instance, physical, device, queue, queue_family };
            Context::adopt(HostDevice::from_raw(raw))?
        };
        Ok(CamsplatDevice { context })
    })
}

/// Closes a device. Plans that were made on it stay.
///
/// # Safety
/// `device` is null or one of this library's that is not closed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_close(device: *mut CamsplatDevice) {
    // SAFETY: as the caller guarantees.
    unsafe { free(device) };
}

/// A request for so many cameras around an object without floor: +Y up, 800 x 800 pixels, 50 degrees.
#[unsafe(no_mangle)]
pub extern "C" fn camsplat_request(views: u32) -> CamsplatRequest {
    CamsplatRequest {
        positions: std::ptr::null(),
        position_count: 0,
        triangles: std::ptr::null(),
        triangle_count: 0,
        views,
        room: false,
        up: [0.0, 1.0, 0.0],
        box_min: [f64::NAN; 3],
        box_max: [f64::NAN; 3],
        floor: f64::NAN,
        clearance: f64::NAN,
        width: 800,
        height: 800,
        fov_degrees: 50.0,
        kept: std::ptr::null(),
        kept_count: 0,
        seed: 0,
        iterations: 0,
        progress: None,
        user: std::ptr::null_mut(),
    }
}

/// Plans; null where that fails.
///
/// # Safety
/// `device` is one of this library's that is not closed, `request` points at one, and its pointers at as many elements as it declares.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_plan(
    device: *const CamsplatDevice,
    request: *const CamsplatRequest,
) -> *mut CamsplatPlan {
    boxed(|| {
        // SAFETY: as the caller guarantees.
        let (device, request) = unsafe { (device.as_ref(), request.as_ref()) };
        let device = device.ok_or_else(|| Error::request("`device` is null"))?;
        let request = request.ok_or_else(|| Error::request("`request` is null"))?;
        // SAFETY: as the caller guarantees.
        let (surface, kept) = unsafe { (surface(request)?, slice(request.kept, request.kept_count, "kept")?) };
        if !(request.fov_degrees > 1.0 && request.fov_degrees < 170.0) {
            let what = format!("`fov_degrees` is {}; give degrees between 1 and 170", request.fov_degrees);
            return Err(Error::request(what));
        }
        let lens = Intrinsics::from_fov(request.width, request.height, request.fov_degrees.to_radians());
        let mut asked = plan(&surface, request.views).up(DVec3::from(request.up)).lens(lens).seed(request.seed);
        if request.room {
            asked = asked.room();
        }
        let (min, max) = (DVec3::from(request.box_min), DVec3::from(request.box_max));
        if !(min.is_nan_mask().all() && max.is_nan_mask().all()) {
            asked = asked.region(Shape::Box { min, max });
        }
        if !request.floor.is_nan() {
            asked = asked.floor(request.floor);
        }
        if !request.clearance.is_nan() {
            asked = asked.clearance(request.clearance);
        }
        if request.iterations > 0 {
            asked = asked.iterations(request.iterations);
        }
        let kept: Vec<Camera> = kept.iter().enumerate().map(|(i, camera)| camera.named(i)).collect();
        let go_on = |done, all| match request.progress {
            Some(progress) if !progress(request.user, done, all) => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        };
        Ok(CamsplatPlan { plan: asked.keep(&kept).run_watched(&device.context, go_on)? })
    })
}

/// Cameras of a plan: those planned, then those kept.
///
/// # Safety
/// `plan` is one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_camera_count(plan: *const CamsplatPlan) -> usize {
    // SAFETY: as the caller guarantees.
    unsafe { plan.as_ref() }.map_or(0, |plan| plan.plan.record.cameras.len())
}

/// Writes one of them to `camera`; false, with nothing written, where there is none of that number.
///
/// # Safety
/// `plan` is one of this library's that is not freed, and `camera` points at memory for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_camera(plan: *const CamsplatPlan, index: usize, camera: *mut CamsplatCamera) -> bool {
    // SAFETY: as the caller guarantees.
    let (plan, camera) = unsafe { (plan.as_ref(), camera.as_mut()) };
    let found = plan.and_then(|plan| plan.plan.record.cameras.get(index));
    let (Some(found), Some(camera)) = (found, camera) else { return false };
    *camera = found.into();
    true
}

/// Decibels by which trained splats are expected to show the surface better than from the best simple layout: 0 where the plan is that
/// layout, NaN where `plan` is null or nothing was expected.
///
/// # Safety
/// `plan` is one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_expected_gain(plan: *const CamsplatPlan) -> f64 {
    // SAFETY: as the caller guarantees.
    let plan = unsafe { plan.as_ref() };
    plan.and_then(|plan| plan.plan.record.expected.as_ref()).map_or(f64::NAN, |expected| expected.db)
}

/// Frees a plan.
///
/// # Safety
/// `plan` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_free(plan: *mut CamsplatPlan) {
    // SAFETY: as the caller guarantees.
    unsafe { free(plan) };
}

impl CamsplatCamera {
    /// As the library has it, under a name of its own.
    fn named(&self, index: usize) -> Camera {
        let [w, x, y, z] = self.rotation;
        Camera {
            name: format!("kept_{index:04}"),
            pose: Pose { position: DVec3::from(self.position), rotation: DQuat::from_xyzw(x, y, z, w).normalize() },
            intrinsics: Intrinsics {
                width: self.width,
                height: self.height,
                focal: self.focal,
                principal: self.principal,
            },
        }
    }
}

impl From<&Camera> for CamsplatCamera {
    fn from(camera: &Camera) -> Self {
        let (q, lens) = (camera.pose.rotation, camera.intrinsics);
        Self {
            position: camera.pose.position.to_array(),
            rotation: [q.w, q.x, q.y, q.z],
            width: lens.width,
            height: lens.height,
            focal: lens.focal,
            principal: lens.principal,
        }
    }
}

/// The surface of a request.
///
/// # Safety
/// The request's pointers point at as many elements as it declares.
unsafe fn surface(request: &CamsplatRequest) -> Result<Surface> {
    let CamsplatRequest { positions, position_count, triangles, triangle_count, .. } = *request;
    // SAFETY: as the caller guarantees.
    let (places, corners) = unsafe {
        let places = slice(positions.cast::<[f64; 3]>(), position_count, "positions")?;
        (places, slice(triangles.cast::<[u32; 3]>(), triangle_count, "triangles")?)
    };
    let positions: Vec<DVec3> = places.iter().copied().map(DVec3::from).collect();
    if triangles.is_null() {
        return Ok(Surface::Points(Points { positions, ..Points::default() }));
    }
    Ok(Surface::Mesh(Mesh { positions, triangles: corners.to_vec(), ..Mesh::default() }))
}

/// The elements that `first` and `count` describe.
///
/// # Safety
/// `first` is null or points at `count` elements.
unsafe fn slice<'a, T>(first: *const T, count: usize, name: &str) -> Result<&'a [T]> {
    match (first.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(Error::request(format!("`{name}` is null, and there should be {count}"))),
        // SAFETY: as the caller guarantees.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(first, count) }),
    }
}

/// What `make` makes, for C to own; null where it fails, and then [`camsplat_error`] gives the reason.
fn boxed<T>(make: impl FnOnce() -> Result<T>) -> *mut T {
    let failure = match catch_unwind(AssertUnwindSafe(make)) {
        Ok(Ok(made)) => return Box::into_raw(Box::new(made)),
        Ok(Err(error)) => error.to_string(),
        Err(_) => "camsplat failed in a way that it should not; please report it".into(),
    };
    let line = CString::new(failure.replace('\0', " ")).unwrap_or_default();
    FAILURE.with_borrow_mut(|failure| *failure = line);
    std::ptr::null_mut()
}

/// Frees what [`boxed`] made.
///
/// # Safety
/// `made` is null or what `boxed` gave, and not freed yet.
unsafe fn free<T>(made: *mut T) {
    if !made.is_null() {
        // SAFETY: as the caller guarantees. A panic on the way must not reach C, and leaves nothing to do.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(unsafe { Box::from_raw(made) })));
    }
}
