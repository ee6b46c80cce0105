// A preloaded library that shows Mesa's Intel driver (ANV) a GPU that is not there, so that it compiles pipelines:
//
//   LD_PRELOAD=./intel_device.so INTEL_NO_HW=1 INTEL_DEVICE=0x9a49 VK_DRIVER_FILES=.../intel_icd.x86_64.json program
//
// INTEL_DEVICE is the PCI device; its render node is a file in memory. Buffers are places in that file, one behind the other, so that
// mapping them is left to the system. What the driver asks of the kernel beside that is granted and does nothing.

#define _GNU_SOURCE
#include <fcntl.h>
#include <drm.h>
#include <errno.h>
#include <i915_drm.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>
#include <xf86drm.h>

static const char NODE[] = "/dev/dri/absent";
enum { MAX_BUFFERS = 1 << 16 };
static const uint64_t PAGE = 1 << 16, ADDRESSES = 1ull << 48;

// The file's end, and where each buffer begins in it.
static _Atomic uint64_t end;
static _Atomic uint32_t buffers;
static uint64_t begins[MAX_BUFFERS];

static uint32_t new_buffer(uint64_t size) {
    uint32_t handle = atomic_fetch_add(&buffers, 1) + 1;
    if (handle >= MAX_BUFFERS) abort();
    begins[handle] = atomic_fetch_add(&end, (size + PAGE - 1) / PAGE * PAGE);
    return handle;
}

static int parameter(const struct drm_i915_getparam *asked) {
    switch (asked->param) {
    case I915_PARAM_CHIPSET_ID: *asked->value = (int)strtol(getenv("INTEL_DEVICE"), NULL, 16); return 0;
    case I915_PARAM_MMAP_VERSION:
    case I915_PARAM_MMAP_GTT_VERSION: *asked->value = 4; return 0;
    case I915_PARAM_CMD_PARSER_VERSION: *asked->value = 10; return 0;
    case I915_PARAM_HAS_ALIASING_PPGTT: *asked->value = I915_GEM_PPGTT_FULL; return 0;
    case I915_PARAM_CS_TIMESTAMP_FREQUENCY: *asked->value = 19200000; return 0;
    case I915_PARAM_REVISION:
    case I915_PARAM_HAS_USERPTR_PROBE:
    case I915_PARAM_HAS_EXEC_TIMELINE_FENCES: *asked->value = 0; return 0;
    default: *asked->value = 1; return 0;
    }
}

int ioctl(int file, unsigned long request, ...) {
    va_list arguments;
    va_start(arguments, request);
    void *argument = va_arg(arguments, void *);
    va_end(arguments);
    switch (request) {
    case DRM_IOCTL_I915_GETPARAM: return parameter(argument);
    case DRM_IOCTL_I915_GEM_CREATE: {
        struct drm_i915_gem_create *create = argument;
        create->handle = new_buffer(create->size);
        return 0;
    }
    case DRM_IOCTL_I915_GEM_CREATE_EXT: {
        struct drm_i915_gem_create_ext *create = argument;
        create->handle = new_buffer(create->size);
        return 0;
    }
    case DRM_IOCTL_I915_GEM_USERPTR: {
        struct drm_i915_gem_userptr *create = argument;
        create->handle = new_buffer(create->user_size);
        return 0;
    }
    case DRM_IOCTL_I915_GEM_MMAP_OFFSET: {
        struct drm_i915_gem_mmap_offset *map = argument;
        map->offset = begins[map->handle];
        return 0;
    }
    case DRM_IOCTL_I915_GEM_CONTEXT_CREATE: ((struct drm_i915_gem_context_create *)argument)->ctx_id = 1; return 0;
    case DRM_IOCTL_I915_GEM_CONTEXT_GETPARAM: {
        struct drm_i915_gem_context_param *asked = argument;
        asked->value = asked->param == I915_CONTEXT_PARAM_GTT_SIZE ? ADDRESSES : 0;
        return 0;
    }
    case DRM_IOCTL_I915_GEM_GET_APERTURE: {
        struct drm_i915_gem_get_aperture *aperture = argument;
        aperture->aper_size = aperture->aper_available_size = ADDRESSES;
        return 0;
    }
    case DRM_IOCTL_I915_QUERY: errno = EINVAL; return -1;  // as kernels that know nothing of engines and memory regions
    case DRM_IOCTL_SYNCOBJ_CREATE: ((struct drm_syncobj_create *)argument)->handle = 1; return 0;
    default:
        if (_IOC_TYPE(request) == DRM_IOCTL_BASE) return 0;
        return (int)syscall(SYS_ioctl, file, request, argument);
    }
}

static int open_node(void) {
    int file = memfd_create("render node", MFD_CLOEXEC);
    return ftruncate(file, 1ll << 40) == 0 ? file : -1;
}

static int opened(const char *path, int flags, mode_t mode) {
    if (strcmp(path, NODE) == 0) return open_node();
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

int open(const char *path, int flags, ...) {
    va_list arguments;
    va_start(arguments, flags);
    mode_t mode = flags & (O_CREAT | __O_TMPFILE) ? va_arg(arguments, mode_t) : 0;
    va_end(arguments);
    return opened(path, flags, mode);
}

int open64(const char *path, int flags, ...) {
    va_list arguments;
    va_start(arguments, flags);
    mode_t mode = flags & (O_CREAT | __O_TMPFILE) ? va_arg(arguments, mode_t) : 0;
    va_end(arguments);
    return opened(path, flags, mode);
}

static drmPciBusInfo bus = {0, 0, 2, 0};
static drmPciDeviceInfo pci = {.vendor_id = 0x8086};
static char *nodes[DRM_NODE_MAX] = {[DRM_NODE_PRIMARY] = "", [DRM_NODE_CONTROL] = "", [DRM_NODE_RENDER] = (char *)NODE};
static drmDevice the_device = {nodes, 1 << DRM_NODE_RENDER, DRM_BUS_PCI, {&bus}, {&pci}};

int drmGetDevices2(uint32_t flags, drmDevicePtr devices[], int most) {
    (void)flags;
    pci.device_id = (uint16_t)strtol(getenv("INTEL_DEVICE"), NULL, 16);
    if (devices && most > 0) devices[0] = &the_device;
    return 1;
}

int drmGetDevice2(int file, uint32_t flags, drmDevicePtr *device) {
    (void)file;
    drmGetDevices2(flags, device, 1);
    return 0;
}

void drmFreeDevice(drmDevicePtr *device) { *device = NULL; }

void drmFreeDevices(drmDevicePtr devices[], int count) {
    (void)devices, (void)count;
}
