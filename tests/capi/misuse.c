/* Invalid requests: each must give a code, no result and a line with the reason of its own, and none may end the program. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "camsplat.h"

static int failures = 0;
static char last[400];

/* A call that should fail in this way. */
static void expect(const char *what, CamsplatResult wanted, CamsplatResult found, CamsplatError **error) {
    char before[sizeof last];
    memcpy(before, last, sizeof last);
    snprintf(last, sizeof last, "%s", camsplat_error_message(*error));
    printf("%s: %d %s\n", what, (int)found, last);
    if (found != wanted || last[0] == 0 || strcmp(last, before) == 0) failures += 1;
    camsplat_error_free(*error);
    *error = NULL;
}

static void refused(const char *what, const CamsplatDevice *device, const CamsplatRequest *request) {
    CamsplatPlan *plan = (CamsplatPlan *)&failures;
    CamsplatError *error;
    CamsplatResult found = camsplat_plan_make(device, request, &plan, &error);
    if (plan != NULL) failures += 1;
    expect(what, CAMSPLAT_RESULT_INVALID, found, &error);
}

static uint32_t stop(void *user, uint32_t done, uint32_t all) {
    (void)done;
    (void)all;
    *(int *)user += 1;
    return 0;
}

/* A plan that is ended at its first iterations is one, and says so. */
static void check_stopped(const CamsplatDevice *device, CamsplatRequest request) {
    int calls = 0;
    CamsplatPlan *plan;
    request.progress = stop;
    request.progress_user = &calls;
    request.iterations = 5000;
    CamsplatError *error;
    if (camsplat_plan_make(device, &request, &plan, &error) != CAMSPLAT_RESULT_OK) {
        printf("stopped: %s\n", camsplat_error_message(error));
        failures += 1;
        return;
    }
    if (calls != 1 || camsplat_plan_interrupted(plan) != 1 || camsplat_plan_camera_count(plan) != request.views) failures += 1;
    if (camsplat_plan_interrupted(NULL) != 0) failures += 1;
    CamsplatCamera camera;
    expect("a camera that is not there", CAMSPLAT_RESULT_INVALID, camsplat_plan_camera(plan, 99, &camera, &error), &error);
    expect("no camera", CAMSPLAT_RESULT_INVALID, camsplat_plan_camera(plan, 0, NULL, &error), &error);
    camsplat_plan_free(plan);
}

static void check_version(void) {
    uint32_t major = 9, minor = 9, patch = 9;
    camsplat_version(&major, &minor, &patch);
    if (major != CAMSPLAT_VERSION_MAJOR || minor != CAMSPLAT_VERSION_MINOR || patch != CAMSPLAT_VERSION_PATCH) failures += 1;
    camsplat_version(NULL, NULL, NULL);
}

static void check_devices(const CamsplatDevice *device) {
    CamsplatDevices *devices;
    CamsplatDeviceInfo info, same;
    CamsplatError *error;
    camsplat_device_info_init(&info, sizeof info);
    camsplat_device_info_init(&same, sizeof same);
    if (camsplat_device_info(device, &same, NULL) != CAMSPLAT_RESULT_OK) failures += 1;
    printf("notes: %s\n", camsplat_device_notes(device));
    if (camsplat_devices_list(&devices, &error) != CAMSPLAT_RESULT_OK || error != NULL) {
        failures += 1;
        return;
    }
    size_t usable = 0, found = 0;
    for (size_t i = 0; i < camsplat_devices_count(devices); ++i) {
        if (camsplat_devices_info(devices, i, &info, NULL) != CAMSPLAT_RESULT_OK) failures += 1;
        printf("%zu: %s, %s, %s, %llu bytes, lacks: %s\n", i, info.name, info.kind, info.driver, (unsigned long long)info.memory, info.lacks);
        if (info.lacks[0] == 0) usable += 1;
        if (strcmp(info.name, same.name) == 0 && info.memory == same.memory) found += 1;
    }
    if (usable == 0 || found == 0) failures += 1;
    expect("a device that is not there", CAMSPLAT_RESULT_INVALID, camsplat_devices_info(devices, 99, &info, &error), &error);
    expect("no info", CAMSPLAT_RESULT_INVALID, camsplat_devices_info(devices, 0, NULL, &error), &error);
    info.struct_size = 3;
    expect("an info that is none", CAMSPLAT_RESULT_INVALID, camsplat_devices_info(devices, 0, &info, &error), &error);
    expect("no list", CAMSPLAT_RESULT_INVALID, camsplat_devices_info(NULL, 0, &info, &error), &error);
    camsplat_devices_free(devices);
    if (camsplat_devices_list(NULL, NULL) != CAMSPLAT_RESULT_INVALID || camsplat_devices_count(NULL) != 0) failures += 1;
}

static void check_hosts(void) {
    CamsplatDevice *device;
    CamsplatError *error;
    CamsplatHost host;
    memset(&host, 0xff, sizeof host);
    expect("no host", CAMSPLAT_RESULT_INVALID, camsplat_device_adopt(NULL, &device, &error), &error);
    expect("a host that was not initialised", CAMSPLAT_RESULT_INVALID, camsplat_device_adopt(&host, &device, &error), &error);
    camsplat_host_init(&host, sizeof host);
    expect("no handles", CAMSPLAT_RESULT_INVALID, camsplat_device_adopt(&host, &device, &error), &error);
    expect("no such device", CAMSPLAT_RESULT_NO_DEVICE, camsplat_device_open("no such device", &device, &error), &error);
    if (device != NULL) failures += 1;
    if (camsplat_device_open("", &device, NULL) != CAMSPLAT_RESULT_OK) failures += 1;
    camsplat_device_close(device);
    expect("no place", CAMSPLAT_RESULT_INVALID, camsplat_device_open(NULL, NULL, &error), &error);
}

int main(void) {
    double corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    uint32_t triangles[2][3] = {{0, 1, 2}, {0, 1, 3}};
    CamsplatDevice *device;
    check_version();
    if (camsplat_device_open(NULL, &device, NULL) != CAMSPLAT_RESULT_OK) return 99;
    check_devices(device);
    check_hosts();
    CamsplatRequest good;
    camsplat_request_init(&good, sizeof good);
    good.views = 4;
    good.positions = &corners[0][0];
    good.position_count = 4;
    good.triangles = &triangles[0][0];
    good.triangle_count = 2;

    check_stopped(device, good);

    CamsplatRequest request = good;
    refused("no device", NULL, &good);
    refused("no request", device, NULL);
    request.struct_size = 0;
    refused("a request that was not initialised", device, &request);
    request = good;
    request.positions = NULL;
    refused("no positions", device, &request);
    request = good;
    request.position_count = 0;
    refused("nothing there", device, &request);
    request = good;
    request.views = 0;
    refused("no views", device, &request);
    request = good;
    request.width = 0;
    refused("no width", device, &request);
    request = good;
    request.fov_degrees = NAN;
    refused("no field of view", device, &request);
    request = good;
    request.up[1] = 0;
    refused("no up", device, &request);
    request = good;
    request.kept_count = 3;
    refused("no kept cameras", device, &request);
    request = good;
    request.clearance = -1;
    refused("negative clearance", device, &request);
    request = good;
    request.box_min[0] = 1;
    refused("half a box", device, &request);
    triangles[1][2] = 4;
    refused("a vertex that is not there", device, &good);
    triangles[1][2] = 3;
    corners[3][1] = INFINITY;
    refused("an infinite vertex", device, &good);
    corners[3][1] = 0;
    CamsplatCamera kept = {.rotation = {0, 0, 0, 0}, .width = 8, .height = 8, .focal = {8, 8}};
    request = good;
    request.kept = &kept;
    request.kept_count = 1;
    refused("a kept camera without rotation", device, &request);
    request = good;
    request.fov_degrees = 200;
    refused("more than half a turn of view", device, &request);
    request = good;
    request.room = 2;
    refused("neither an object nor a room", device, &request);
    request = good;
    request.position_count = (size_t)1 << 40;
    refused("more vertices than indices reach", device, &request);
    request = good;
    request.triangle_count = SIZE_MAX / 2;
    refused("more triangles than memory has", device, &request);
    request = good;
    request.views = UINT32_MAX;
    refused("more views than a plan has", device, &request);
    request = good;
    request.reserved = 1;
    refused("a field of later versions", device, &request);

    CamsplatCamera camera;
    CamsplatError *error;
    if (camsplat_plan_camera_count(NULL) != 0 || !isnan(camsplat_plan_expected_gain(NULL))) failures += 1;
    expect("a camera of no plan", CAMSPLAT_RESULT_INVALID, camsplat_plan_camera(NULL, 0, &camera, &error), &error);
    camsplat_plan_free(NULL);
    camsplat_devices_free(NULL);
    camsplat_device_close(NULL);
    camsplat_error_free(NULL);
    camsplat_device_close(device);
    if (camsplat_error_message(NULL)[0] != 0) failures += 1;
    return failures;
}
