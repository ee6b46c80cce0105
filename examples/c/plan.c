/* Plans cameras around a cube from C, on a Vulkan device of the program's own.
 *
 *   cargo rustc --release --lib --no-default-features --features capi --crate-type cdylib
 *   cc -Iinclude examples/c/plan.c -Ltarget/release -lcamsplat -lvulkan -o plan && LD_LIBRARY_PATH=target/release ./plan
 */
#include "host.h"

static uint32_t progress(void *user, uint32_t done, uint32_t all) {
    (void)user;
    fprintf(stderr, "%u of %u iterations\n", done, all);
    return 1; /* continue */
}

int main(void) {
    CamsplatHost host = make_host();
    CamsplatDevice *device;
    CamsplatPlan *plan;
    CamsplatError *error;
    if (camsplat_device_adopt(&host, &device, &error) != CAMSPLAT_RESULT_OK) fail(error);

    CamsplatRequest request = request_around_cube();
    request.progress = progress;
    if (camsplat_plan_make(device, &request, &plan, &error) != CAMSPLAT_RESULT_OK) fail(error);
    print_cameras(plan);
    fprintf(stderr, "%+.2f dB expected against the best simple layout\n", camsplat_plan_expected_gain(plan));

    camsplat_plan_free(plan);
    camsplat_device_close(device);
    destroy_host(&host);
    return 0;
}
