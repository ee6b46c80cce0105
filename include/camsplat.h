/* camsplat for C. Made of src/capi.rs by cbindgen; see examples/plan.c. */

#ifndef CAMSPLAT_H
#define CAMSPLAT_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// A Vulkan device that plans are made on. Every function of this library may be called from any thread, none throws or aborts on bad
// input; a device must not be closed while a plan is being made on it.
typedef struct CamsplatDevice CamsplatDevice;

// A finished plan.
typedef struct CamsplatPlan CamsplatPlan;

// Vulkan objects of the application's own. All stay the application's, and must outlive the `CamsplatDevice` that is made with them.
// While a function of this library runs with that device, nothing else may use `queue`: submit to it, present, or wait for it or the
// whole device. Adopt a queue once, since two `CamsplatDevice`s on one queue do not know of each other.
typedef struct CamsplatHost {
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
} CamsplatHost;

// A camera: right-handed, world from camera, axes of the camera as in OpenCV (X right, Y down, Z forward).
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

// What is to be planned; `camsplat_request` fills in all but the surface.
typedef struct CamsplatRequest {
  // Vertices, or points: x, y and z each.
  const double *positions;
  // How many there are.
  size_t position_count;
  // Triangles: three indices of vertices each, counter-clockwise from outside; null where the surface is points.
  const uint32_t *triangles;
  // How many triangles there are.
  size_t triangle_count;
  // Cameras to plan.
  uint32_t views;
  // Whether the cameras are inside a room, not around an object.
  bool room;
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
  // Iterations; 0: the default for objects or rooms.
  uint32_t iterations;
  // Called now and then, on the thread of `camsplat_plan`, with `user`, the iterations done and their total; or null. Returning false
  // ends the plan early with what there is by then. It must return normally (no exception, no longjmp), and must not close the device.
  bool (*progress)(void *user, uint32_t done, uint32_t all);
  // What `progress` is called with.
  void *user;
} CamsplatRequest;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// What went wrong in the last call of this thread that failed: one line of UTF-8, valid until the next call that fails.
const char *camsplat_error(void);

// Opens the best Vulkan device there is, or the one whose name holds `name`; null where that fails.
//
// # Safety
// `name` is null or a string that ends in NUL.
struct CamsplatDevice *camsplat_open(const char *name);

// Uses a Vulkan device of the application's own; null where that fails.
//
// # Safety
// `host` points at one, whose handles are valid and belong together.
struct CamsplatDevice *camsplat_adopt(const struct CamsplatHost *host);

// Closes a device. Plans that were made on it stay.
//
// # Safety
// `device` is null or one of this library's that is not closed.
void camsplat_close(struct CamsplatDevice *device);

// A request for so many cameras around an object without floor: +Y up, 800 x 800 pixels, 50 degrees.
struct CamsplatRequest camsplat_request(uint32_t views);

// Plans; null where that fails.
//
// # Safety
// `device` is one of this library's that is not closed, `request` points at one, and its pointers at as many elements as it declares.
struct CamsplatPlan *camsplat_plan(const struct CamsplatDevice *device,
                                   const struct CamsplatRequest *request);

// Cameras of a plan: those planned, then those kept.
//
// # Safety
// `plan` is one of this library's that is not freed.
size_t camsplat_camera_count(const struct CamsplatPlan *plan);

// Writes one of them to `camera`; false, with nothing written, where there is none of that number.
//
// # Safety
// `plan` is one of this library's that is not freed, and `camera` points at memory for one.
bool camsplat_camera(const struct CamsplatPlan *plan, size_t index, struct CamsplatCamera *camera);

// Decibels by which trained splats are expected to show the surface better than from the best simple layout: 0 where the plan is that
// layout, NaN where `plan` is null or nothing was expected.
//
// # Safety
// `plan` is one of this library's that is not freed.
double camsplat_expected_gain(const struct CamsplatPlan *plan);

// Frees a plan.
//
// # Safety
// `plan` is null or one of this library's that is not freed.
void camsplat_free(struct CamsplatPlan *plan);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* CAMSPLAT_H */
