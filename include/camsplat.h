/* camsplat for C. Made of src/app/capi by cbindgen; see docs/guide/c.md and examples/c. */

#ifndef CAMSPLAT_H
#define CAMSPLAT_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// Version of this header: major, minor and patch.
#define CAMSPLAT_VERSION_MAJOR 0

// See `CAMSPLAT_VERSION_MAJOR`.
#define CAMSPLAT_VERSION_MINOR 1

// See `CAMSPLAT_VERSION_MAJOR`.
#define CAMSPLAT_VERSION_PATCH 0

// How a call ended. Later versions may have further codes.
typedef enum CamsplatResult {
  // It did what it should.
  CAMSPLAT_RESULT_OK = 0,
  // The request makes no sense, or an argument is null or was not initialised: the caller can mend it.
  CAMSPLAT_RESULT_INVALID = 1,
  // No Vulkan device can be used, or not the one named or lent.
  CAMSPLAT_RESULT_NO_DEVICE = 2,
  // The plan does not fit the device's memory.
  CAMSPLAT_RESULT_OUT_OF_MEMORY = 3,
  // The device was lost. Close it and, where the application lent it, make another.
  CAMSPLAT_RESULT_DEVICE_LOST = 4,
  // The device has not finished a submission within the limit. What runs on it may still run: what it uses stays allocated, also after
  // `camsplat_device_close`. Wait for a device that the application lent (`vkDeviceWaitIdle`, under its lock) before it is destroyed.
  CAMSPLAT_RESULT_UNFINISHED = 5,
  // A Vulkan call failed in another way.
  CAMSPLAT_RESULT_VULKAN = 6,
  // The application ended it: `lock` returned 0.
  CAMSPLAT_RESULT_INTERRUPTED = 7,
  // A fault of the library's own; please report it.
  CAMSPLAT_RESULT_INTERNAL = 8,
} CamsplatResult;

// A Vulkan device that plans are made on. Several threads may plan on one device at once.
typedef struct CamsplatDevice CamsplatDevice;

// The Vulkan devices of this machine.
typedef struct CamsplatDevices CamsplatDevices;

// Why a call failed. Whoever receives one frees it with `camsplat_error_free`.
typedef struct CamsplatError CamsplatError;

// A finished plan. It needs its device no more.
typedef struct CamsplatPlan CamsplatPlan;

// What a device is. Strings live as long as the `CamsplatDevices` or `CamsplatDevice` that they were asked of.
typedef struct CamsplatDeviceInfo {
  // Set by `camsplat_device_info_init`.
  size_t struct_size;
  // Name, as its driver gives it.
  const char *name;
  // Name and version of the driver.
  const char *driver;
  // "discrete GPU", "integrated GPU", "virtual GPU", "CPU" or "other".
  const char *kind;
  // What the library needs and the device does not have; empty where it can be used.
  const char *lacks;
  // Bytes of its memory.
  uint64_t memory;
} CamsplatDeviceInfo;

// Vulkan objects of the application's own, which `camsplat_host_init` sets to null. All stay the application's, and must outlive the
// `CamsplatDevice` that is made with them.
//
// A queue takes one submission at a time. While a function of this library runs with the device, either nothing else uses `queue`, or
// the application gives `lock` and `unlock` and takes the same lock wherever it submits to the queue, presents, or waits for it or the
// whole device. The library holds the lock for one `vkQueueSubmit` at a time, never while it waits.
typedef struct CamsplatHost {
  // Set by `camsplat_host_init`.
  size_t struct_size;
  // The loader's `vkGetInstanceProcAddr`.
  void *(*get_instance_proc_addr)(void*, const char*);
  // `VkInstance`, of Vulkan 1.2 or later.
  void *instance;
  // `VkPhysicalDevice`.
  void *physical_device;
  // `VkDevice`, made with `VK_KHR_push_descriptor`.
  void *device;
  // `VkQueue` that can compute.
  void *queue;
  // Its family.
  uint32_t queue_family;
  // 1 where the device was made with `VK_EXT_memory_budget`: what fits is then decided by what is free.
  uint32_t memory_budget;
  // Called before each submission with `lock_user`, on the thread that called this library; or null, together with `unlock`. It may wait
  // for as long as the application likes. Where it returns 0 the queue is not used and `unlock` not called, and the call of this library
  // ends with `CAMSPLAT_RESULT_INTERRUPTED`: so an application that is closed ends a plan at any time. It must return normally.
  uint32_t (*lock)(void *lock_user);
  // Called after each submission, on the same thread.
  void (*unlock)(void *lock_user);
  // What both are called with; usable from every thread that calls this library.
  void *lock_user;
  // How long a submission should take, in milliseconds; 0: 100 ms. Where it is given, the library submits one at a time and waits for its
  // end before the next, so that what the application submits waits for no more than one. Lengths are learnt from one submission to the
  // next; a stage that alone takes longer is not divided.
  double submission_ms;
  // What names and labels in capture tools begin with ("camsplat/"), where the instance was made with `VK_EXT_debug_utils`; null: none are
  // given.
  const char *label_prefix;
  // How long a submission may take before the call fails with `CAMSPLAT_RESULT_UNFINISHED`, in milliseconds, with what the application
  // has on the queue before it; 0: a minute, and without end on CPU devices.
  double wait_limit_ms;
} CamsplatHost;

// A camera: right-handed, world from camera, axes of the camera as in OpenCV (X right, Y down, Z forward). It never changes: what
// cameras may have besides in later versions has functions of its own.
typedef struct CamsplatCamera {
  // Position, in the surface's frame and units.
  double position[3];
  // Rotation: a unit quaternion, w first.
  double rotation[4];
  // Width of the image in pixels.
  uint32_t width;
  // Height of the image in pixels.
  uint32_t height;
  // Focal lengths in pixels, x and y.
  double focal[2];
  // Principal point in pixels, x and y; the corner of the image is (0, 0).
  double principal[2];
} CamsplatCamera;

// What is to be planned. `camsplat_request_init` sets all but the surface and `views`, to a plan around an object without floor: +Y up,
// 800 x 800 pixels, 50 degrees.
typedef struct CamsplatRequest {
  // Set by `camsplat_request_init`.
  size_t struct_size;
  // Vertices, or points: x, y and z each.
  const double *positions;
  // How many there are.
  size_t position_count;
  // Triangles: three indices of vertices each, counter-clockwise from outside; null where the surface is points. A mesh without
  // triangles, such as an empty array, is refused where this is not null.
  const uint32_t *triangles;
  // How many triangles there are.
  size_t triangle_count;
  // Cameras to plan: up to 200,000, and 2,500 on CPU devices, with those kept.
  uint32_t views;
  // 1 where the cameras are inside a room, 0 where they are around an object.
  uint32_t room;
  // Which way is up.
  double up[3];
  // The lower corner of the cameras' box; NaN: derived from the surface.
  double box_min[3];
  // The upper corner.
  double box_max[3];
  // Cameras and viewers stay above this height along up; NaN: no floor.
  double floor;
  // Minimum distance between cameras and the surface; NaN: derived from the surface.
  double clearance;
  // Width of the cameras' images in pixels.
  uint32_t width;
  // Height of the cameras' images in pixels.
  uint32_t height;
  // Their horizontal field of view in degrees.
  double fov_degrees;
  // Cameras that exist already: they count, and never move.
  const struct CamsplatCamera *kept;
  // How many of these there are.
  size_t kept_count;
  // Another seed gives another plan; the same seed the same one on the same device and driver.
  uint64_t seed;
  // Called now and then, on the thread of `camsplat_plan_make`, with `progress_user`, the iterations done and their total; or null.
  // Returning 0 ends the iterations early; the plan is what there is by then, and `camsplat_plan_interrupted`. It must return normally
  // (no exception, no longjmp), and must not close the device.
  uint32_t (*progress)(void *progress_user, uint32_t done, uint32_t all);
  // What `progress` is called with.
  void *progress_user;
  // Iterations; 0: the default for objects or rooms.
  uint32_t iterations;
  // 0; further fields of 32 bits may take its place.
  uint32_t reserved;
} CamsplatRequest;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Version of the library that is loaded. Programs that were compiled against an older header of the same major version run with it; for
// major version 0, of the same minor version.
//
// Threads: any, at any time.
//
// # Safety
// Each pointer is null or points at a number that may be written.
void camsplat_version(uint32_t *major,
                      uint32_t *minor,
                      uint32_t *patch);

// Initialises what `camsplat_devices_info` and `camsplat_device_info` fill in; `size` is `sizeof *info`.
//
// Threads: any.
//
// # Safety
// `info` is null or points at `size` bytes.
void camsplat_device_info_init(struct CamsplatDeviceInfo *info,
                               size_t size);

// Initialises what `camsplat_device_adopt` takes; `size` is `sizeof *host`.
//
// Threads: any.
//
// # Safety
// `host` is null or points at `size` bytes.
void camsplat_host_init(struct CamsplatHost *host, size_t size);

// Lists the Vulkan devices of this machine, those that cannot be used too. `devices` receives the list, or null where this fails.
//
// Threads: any.
//
// # Safety
// `devices` points at a pointer; `error` is null or points at one.
enum CamsplatResult camsplat_devices_list(struct CamsplatDevices **devices,
                                          struct CamsplatError **error);

// How many there are; 0 of null.
//
// Threads: any, until `devices` is freed.
//
// # Safety
// `devices` is null or one of this library's that is not freed.
size_t camsplat_devices_count(const struct CamsplatDevices *devices);

// What the device at `index` is.
//
// Threads: any, until `devices` is freed.
//
// # Safety
// `devices` is null or one of this library's that is not freed, `info` is null or was initialised, `error` is null or points at a pointer.
enum CamsplatResult camsplat_devices_info(const struct CamsplatDevices *devices,
                                          size_t index,
                                          struct CamsplatDeviceInfo *info,
                                          struct CamsplatError **error);

// Frees a list; null is let be.
//
// Threads: any, once no other function uses it.
//
// # Safety
// `devices` is null or one of this library's that is not freed.
void camsplat_devices_free(struct CamsplatDevices *devices);

// Opens a Vulkan device: the best one where `name` is null or empty, else the one of that number in `camsplat_devices_list` ("1"), or the first
// whose name holds `name`, in whatever case. `device` receives it, or null where this fails.
//
// Threads: any.
//
// # Safety
// `name` is null or a string that ends in NUL, `device` points at a pointer, `error` is null or points at one.
enum CamsplatResult camsplat_device_open(const char *name,
                                         struct CamsplatDevice **device,
                                         struct CamsplatError **error);

// Uses a Vulkan device of the application's own. `device` receives it, or null where this fails. Adopt a queue once: two
// `CamsplatDevice`s on one queue know of each other by `lock` alone.
//
// Threads: any; `host` itself is not needed once this returns.
//
// # Safety
// `host` is null or was initialised, and its handles are valid and belong together; `device` points at a pointer, `error` is null or
// points at one.
enum CamsplatResult camsplat_device_adopt(const struct CamsplatHost *host,
                                          struct CamsplatDevice **device,
                                          struct CamsplatError **error);

// What the device is.
//
// Threads: any, until `device` is closed.
//
// # Safety
// `device` is null or one of this library's that is not closed, `info` is null or was initialised, `error` is null or points at a pointer.
enum CamsplatResult camsplat_device_info(const struct CamsplatDevice *device,
                                         struct CamsplatDeviceInfo *info,
                                         struct CamsplatError **error);

// What a user should know of the choice of the device: which GPU was passed over and for what, and whether there is none. Lines with
// newlines between them, empty where there is nothing to say; they live as long as `device`.
//
// Threads: any, until `device` is closed.
//
// # Safety
// `device` is null or one of this library's that is not closed.
const char *camsplat_device_notes(const struct CamsplatDevice *device);

// Closes a device; null is let be. Plans that were made on it stay. What the application lent is not destroyed.
//
// Threads: any, once no other function uses it.
//
// # Safety
// `device` is null or one of this library's that is not closed.
void camsplat_device_close(struct CamsplatDevice *device);

// One line of UTF-8 that says what was wrong, where, and what to do. It lives as long as `error`; of null it is empty.
//
// Threads: any, until `error` is freed.
//
// # Safety
// `error` is null or one of this library's that is not freed.
const char *camsplat_error_message(const struct CamsplatError *error);

// Frees an error; null is let be.
//
// Threads: any, once.
//
// # Safety
// `error` is null or one of this library's that is not freed.
void camsplat_error_free(struct CamsplatError *error);

// Initialises a request; `size` is `sizeof *request`.
//
// Threads: any.
//
// # Safety
// `request` is null or points at `size` bytes.
void camsplat_request_init(struct CamsplatRequest *request, size_t size);

// Plans. `plan` receives the plan, or null where this fails.
//
// Before the first iterations and after the last `progress` is not called; there, `lock` of an adopted device ends a plan.
//
// Threads: any, several on one device too, but none of a process that was forked after a plan; the calling thread works and waits until the plan is done. A frame loop calls it on a thread
// of its own, with a device that was adopted with `lock`, `unlock` and `submission_ms` (`examples/c/frame_loop.c`), and lets `lock`
// return, with 0 to end the plan, until this has returned.
//
// # Safety
// `device` is null or one of this library's that is not closed while this runs, `request` is null or was initialised, its pointers are
// null or point at as many elements as it declares, `plan` points at a pointer, `error` is null or points at one.
enum CamsplatResult camsplat_plan_make(const struct CamsplatDevice *device,
                                       const struct CamsplatRequest *request,
                                       struct CamsplatPlan **plan,
                                       struct CamsplatError **error);

// Cameras of a plan: those planned, then those kept; 0 of null.
//
// Threads: any, until `plan` is freed.
//
// # Safety
// `plan` is null or one of this library's that is not freed.
size_t camsplat_plan_camera_count(const struct CamsplatPlan *plan);

// Writes the camera at `index` to `camera`; nothing is written where this fails.
//
// Threads: any, until `plan` is freed.
//
// # Safety
// `plan` is null or one of this library's that is not freed, `camera` is null or points at memory for one, `error` is null or points at a
// pointer.
enum CamsplatResult camsplat_plan_camera(const struct CamsplatPlan *plan,
                                         size_t index,
                                         struct CamsplatCamera *camera,
                                         struct CamsplatError **error);

// Decibels by which trained splats are expected to show the surface better than from the best simple layout: 0 where the plan is that
// layout, less than 0 at times where the plan was interrupted, NaN where `plan` is null or nothing was expected.
//
// Threads: any, until `plan` is freed.
//
// # Safety
// `plan` is null or one of this library's that is not freed.
double camsplat_plan_expected_gain(const struct CamsplatPlan *plan);

// 1 where `progress` ended the iterations early, 0 where they are complete or `plan` is null.
//
// Threads: any, until `plan` is freed.
//
// # Safety
// `plan` is null or one of this library's that is not freed.
uint32_t camsplat_plan_interrupted(const struct CamsplatPlan *plan);

// Frees a plan; null is let be.
//
// Threads: any, once no other function uses it.
//
// # Safety
// `plan` is null or one of this library's that is not freed.
void camsplat_plan_free(struct CamsplatPlan *plan);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* CAMSPLAT_H */
