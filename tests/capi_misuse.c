/* Invalid requests: each must give a null pointer and a line with the reason, and none may end the program. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "camsplat.h"

static int failures = 0;
static char last[400];

static void refused(const char *what, const CamsplatDevice *device, const CamsplatRequest *request) {
    char before[sizeof last];
    memcpy(before, last, sizeof last);
    CamsplatPlan *plan = camsplat_plan(device, request);
    snprintf(last, sizeof last, "%s", camsplat_error());
    printf("%s: %s\n", what, plan == NULL ? last : "was planned");
    /* Each case has a reason of its own: a line that stayed from the one before is none. */
    if (plan != NULL || strcmp(last, before) == 0) failures += 1;
    camsplat_free(plan);
}

int main(void) {
    double corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    uint32_t triangles[2][3] = {{0, 1, 2}, {0, 1, 3}};
    CamsplatDevice *device = camsplat_open(NULL);
    if (device == NULL) return 2;
    CamsplatRequest good = camsplat_request(4);
    good.positions = &corners[0][0];
    good.position_count = 4;
    good.triangles = &triangles[0][0];
    good.triangle_count = 2;

    CamsplatRequest request = good;
    refused("no device", NULL, &good);
    refused("no request", device, NULL);
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

    CamsplatCamera kept = {.rotation = {0, 0, 0, 0}, .width = 8, .height = 8, .focal = {8, 8}};
    corners[3][1] = 0;
    request = good;
    request.kept = &kept;
    request.kept_count = 1;
    refused("a kept camera without rotation", device, &request);

    CamsplatHost host = {0};
    if (camsplat_adopt(NULL) != NULL || strstr(camsplat_error(), "`host` is null") == NULL) failures += 1;
    if (camsplat_adopt(&host) != NULL || strstr(camsplat_error(), "every handle") == NULL) failures += 1;
    if (camsplat_open("no such device") != NULL || strstr(camsplat_error(), "no such device") == NULL) failures += 1;
    request = good;
    request.fov_degrees = 200;
    refused("more than half a turn of view", device, &request);
    CamsplatCamera camera;
    if (camsplat_camera_count(NULL) != 0 || camsplat_camera(NULL, 0, &camera)) failures += 1;
    camsplat_free(NULL);
    camsplat_close(NULL);
    camsplat_close(device);
    return failures;
}
