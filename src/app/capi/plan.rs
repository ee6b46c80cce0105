//! Plans for C.

use std::ffi::c_void;
use std::mem::size_of;
use std::ops::ControlFlow;

use glam::{DQuat, DVec3};

use super::device::CamsplatDevice;
use super::failure::{CamsplatError, CamsplatResult, answer, answer_with, free, given};
use super::versioned::{Versioned, init, read};
use crate::planner::plan::pipeline::Plan;
use crate::planner::plan::request::plan;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::region::Shape;
use crate::scene::surface::{Mesh, Points, Surface};
use crate::{Error, Result};

/// A finished plan. It needs its device no more.
pub struct CamsplatPlan {
    plan: Plan,
}

/// A camera: right-handed, world from camera, axes of the camera as in OpenCV (X right, Y down, Z forward). It never changes: what
/// cameras may have besides in later versions has functions of its own.
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

/// What is to be planned. `camsplat_request_init` sets all but the surface and `views`, to a plan around an object without floor: +Y up,
/// 800 x 800 pixels, 50 degrees.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct CamsplatRequest {
    /// Set by `camsplat_request_init`.
    pub struct_size: usize,
    /// Vertices, or points: x, y and z each.
    pub positions: *const f64,
    /// How many there are.
    pub position_count: usize,
    /// Triangles: three indices of vertices each, counter-clockwise from outside; null where the surface is points. A mesh without
    /// triangles, such as an empty array, is refused where this is not null.
    pub triangles: *const u32,
    /// How many triangles there are.
    pub triangle_count: usize,
    /// Cameras to plan: up to 200,000, and 2,500 on CPU devices, with those kept.
    pub views: u32,
    /// 1 where the cameras are inside a room, 0 where they are around an object.
    pub room: u32,
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
    /// Called now and then, on the thread of `camsplat_plan_make`, with `progress_user`, the iterations done and their total; or null.
    /// Returning 0 ends the iterations early; the plan is what there is by then, and `camsplat_plan_interrupted`. It must return normally
    /// (no exception, no longjmp), and must not close the device.
    pub progress: Option<extern "C" fn(progress_user: *mut c_void, done: u32, all: u32) -> u32>,
    /// What `progress` is called with.
    pub progress_user: *mut c_void,
    /// Iterations; 0: the default for objects or rooms.
    pub iterations: u32,
    /// 0; further fields of 32 bits may take its place.
    pub reserved: u32,
}

// SAFETY: all fields are integers, floats, pointers and a function that may be null; the size comes first.
unsafe impl Versioned for CamsplatRequest {
    const NAME: &'static str = "CamsplatRequest";
    const INIT: &'static str = "camsplat_request_init";
    const FIRST_SIZE: usize = size_of::<Self>();

    fn initial() -> Self {
        Self {
            struct_size: 0,
            positions: std::ptr::null(),
            position_count: 0,
            triangles: std::ptr::null(),
            triangle_count: 0,
            views: 0,
            room: 0,
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
            progress: None,
            progress_user: std::ptr::null_mut(),
            iterations: 0,
            reserved: 0,
        }
    }
}

/// Initialises a request; `size` is `sizeof *request`.
///
/// Threads: any.
///
/// # Safety
/// `request` is null or points at `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_request_init(request: *mut CamsplatRequest, size: usize) {
    // SAFETY: as the caller guarantees.
    unsafe { init(request, size) };
}

/// Plans. `plan` receives the plan, or null where this fails.
///
/// Before the first iterations and after the last `progress` is not called; there, `lock` of an adopted device ends a plan.
///
/// Threads: any, several on one device too, but none of a process that was forked after a plan; the calling thread works and waits until the plan is done. A frame loop calls it on a thread
/// of its own, with a device that was adopted with `lock`, `unlock` and `submission_ms` (`examples/c/frame_loop.c`), and lets `lock`
/// return, with 0 to end the plan, until this has returned.
///
/// # Safety
/// `device` is null or one of this library's that is not closed while this runs, `request` is null or was initialised, its pointers are
/// null or point at as many elements as it declares, `plan` points at a pointer, `error` is null or points at one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_plan_make(
    device: *const CamsplatDevice,
    request: *const CamsplatRequest,
    plan: *mut *mut CamsplatPlan,
    error: *mut *mut CamsplatError,
) -> CamsplatResult {
    // SAFETY: as the caller guarantees.
    unsafe { answer_with(plan, error, || made(given(device, "device")?, &read(request)?)) }
}

/// Cameras of a plan: those planned, then those kept; 0 of null.
///
/// Threads: any, until `plan` is freed.
///
/// # Safety
/// `plan` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_plan_camera_count(plan: *const CamsplatPlan) -> usize {
    // SAFETY: as the caller guarantees.
    unsafe { plan.as_ref() }.map_or(0, |plan| plan.plan.record.cameras.len())
}

/// Writes the camera at `index` to `camera`; nothing is written where this fails.
///
/// Threads: any, until `plan` is freed.
///
/// # Safety
/// `plan` is null or one of this library's that is not freed, `camera` is null or points at memory for one, `error` is null or points at a
/// pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_plan_camera(
    plan: *const CamsplatPlan,
    index: usize,
    camera: *mut CamsplatCamera,
    error: *mut *mut CamsplatError,
) -> CamsplatResult {
    // SAFETY: as the caller guarantees.
    unsafe {
        answer(error, || {
            let all = &given(plan, "plan")?.plan.record.cameras;
            let none = || Error::request(format!("`index` is {index}, and there are {} cameras", all.len()));
            let found = all.get(index).ok_or_else(none)?;
            if camera.is_null() {
                return Err(Error::request("`camera` is null"));
            }
            camera.write(found.into());
            Ok(())
        })
    }
}

/// Decibels by which trained splats are expected to show the surface better than from the best simple layout: 0 where the plan is that
/// layout, less than 0 at times where the plan was interrupted, NaN where `plan` is null or nothing was expected.
///
/// Threads: any, until `plan` is freed.
///
/// # Safety
/// `plan` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_plan_expected_gain(plan: *const CamsplatPlan) -> f64 {
    // SAFETY: as the caller guarantees.
    let plan = unsafe { plan.as_ref() };
    plan.and_then(|plan| plan.plan.record.expected.as_ref()).map_or(f64::NAN, |expected| expected.db)
}

/// 1 where `progress` ended the iterations early, 0 where they are complete or `plan` is null.
///
/// Threads: any, until `plan` is freed.
///
/// # Safety
/// `plan` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_plan_interrupted(plan: *const CamsplatPlan) -> u32 {
    // SAFETY: as the caller guarantees.
    unsafe { plan.as_ref() }.is_some_and(|plan| plan.plan.interrupted()).into()
}

/// Frees a plan; null is let be.
///
/// Threads: any, once no other function uses it.
///
/// # Safety
/// `plan` is null or one of this library's that is not freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn camsplat_plan_free(plan: *mut CamsplatPlan) {
    // SAFETY: as the caller guarantees.
    unsafe { free(plan) };
}

/// # Safety
/// The request's pointers are null or point at as many elements as it declares.
unsafe fn made(device: &CamsplatDevice, request: &CamsplatRequest) -> Result<CamsplatPlan> {
    // SAFETY: as the caller guarantees.
    let (surface, kept) = unsafe { (surface(request)?, slice(request.kept, request.kept_count, "kept")?) };
    if !(request.fov_degrees > 1.0 && request.fov_degrees < 170.0) {
        let what = format!("`fov_degrees` is {}; give more than 1 and less than 170 degrees", request.fov_degrees);
        return Err(Error::request(what));
    }
    if request.reserved != 0 {
        return Err(Error::request(format!("`reserved` is {}; it is to be 0", request.reserved)));
    }
    let lens = Intrinsics::from_fov(request.width, request.height, request.fov_degrees.to_radians());
    let mut asked = plan(&surface, request.views).up(DVec3::from(request.up)).lens(lens).seed(request.seed);
    match request.room {
        0 => (),
        1 => asked = asked.room(),
        other => return Err(Error::request(format!("`room` is {other}; give 0 or 1"))),
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
        Some(progress) if progress(request.progress_user, done, all) == 0 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    Ok(CamsplatPlan { plan: asked.keep(&kept).run_watched(&device.context, go_on)? })
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
/// As for [`made`].
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

/// Most elements of a request: indices of vertices have 32 bits.
const MOST: usize = u32::MAX as usize;

/// The elements that `first` and `count` describe.
///
/// # Safety
/// `first` is null or points at `count` elements.
unsafe fn slice<'a, T>(first: *const T, count: usize, name: &str) -> Result<&'a [T]> {
    match (first.is_null(), count) {
        (_, 0) => Ok(&[]),
        (_, MOST..) => Err(Error::request(format!("`{name}` has {count} elements; give fewer than {MOST}"))),
        (true, _) => Err(Error::request(format!("`{name}` is null, and there should be {count}"))),
        // SAFETY: as the caller guarantees.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(first, count) }),
    }
}
