/* What an application with Vulkan has anyway: an instance, a device and a queue that can compute. */
#ifndef HOST_H
#define HOST_H

#include <stdio.h>
#include <stdlib.h>
#include <vulkan/vulkan.h>

#include "camsplat.h"

static void check(VkResult result, const char *what) {
    if (result != VK_SUCCESS) {
        fprintf(stderr, "%s: %d\n", what, result);
        exit(1);
    }
}

/* The line of an error of camsplat's, and the end of the program. */
static void fail(CamsplatError *error) {
    fprintf(stderr, "error: %s\n", camsplat_error_message(error));
    camsplat_error_free(error);
    exit(1);
}

static CamsplatHost make_host(void) {
    CamsplatHost host;
    camsplat_host_init(&host, sizeof host);
    VkInstance instance;
    VkApplicationInfo application = {.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_2};
    VkInstanceCreateInfo instance_info = {
        .sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO,
        .pApplicationInfo = &application,
    };
    check(vkCreateInstance(&instance_info, NULL, &instance), "vkCreateInstance");

    uint32_t count = 1;
    VkPhysicalDevice physical = VK_NULL_HANDLE;
    vkEnumeratePhysicalDevices(instance, &count, &physical);
    if (count == 0) check(VK_ERROR_INITIALIZATION_FAILED, "no Vulkan driver");

    VkQueueFamilyProperties families[16];
    uint32_t family_count = 16;
    vkGetPhysicalDeviceQueueFamilyProperties(physical, &family_count, families);
    while (host.queue_family < family_count && !(families[host.queue_family].queueFlags & VK_QUEUE_COMPUTE_BIT)) {
        host.queue_family += 1;
    }
    float priority = 1.0f;
    VkDeviceQueueCreateInfo queue_info = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO,
        .queueFamilyIndex = host.queue_family,
        .queueCount = 1,
        .pQueuePriorities = &priority,
    };
    const char *extensions[] = {"VK_KHR_push_descriptor"}; /* the one that the planner needs */
    VkDeviceCreateInfo device_info = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO,
        .queueCreateInfoCount = 1,
        .pQueueCreateInfos = &queue_info,
        .enabledExtensionCount = 1,
        .ppEnabledExtensionNames = extensions,
    };
    VkDevice device;
    VkQueue queue;
    check(vkCreateDevice(physical, &device_info, NULL, &device), "vkCreateDevice");
    vkGetDeviceQueue(device, host.queue_family, 0, &queue);

    host.get_instance_proc_addr = (void *(*)(void *, const char *))vkGetInstanceProcAddr;
    host.instance = instance;
    host.physical_device = physical;
    host.device = device;
    host.queue = queue;
    return host;
}

static void destroy_host(const CamsplatHost *host) {
    vkDestroyDevice(host->device, NULL);
    vkDestroyInstance(host->instance, NULL);
}

/* A request for twelve cameras around a cube that rests on the ground, Z up. */
static CamsplatRequest request_around_cube(void) {
    static const double corners[8][3] = {
        {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {-1, -1, 2}, {1, -1, 2}, {1, 1, 2}, {-1, 1, 2},
    };
    static const uint32_t triangles[12][3] = {
        {0, 2, 1}, {0, 3, 2}, {4, 5, 6}, {4, 6, 7}, {0, 1, 5}, {0, 5, 4},
        {1, 2, 6}, {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7},
    };
    CamsplatRequest request;
    camsplat_request_init(&request, sizeof request);
    request.views = 12;
    request.positions = &corners[0][0];
    request.position_count = 8;
    request.triangles = &triangles[0][0];
    request.triangle_count = 12;
    request.up[1] = 0.0;
    request.up[2] = 1.0;
    request.floor = 0.0;
    return request;
}

static void print_cameras(const CamsplatPlan *plan) {
    for (size_t i = 0; i < camsplat_plan_camera_count(plan); ++i) {
        CamsplatCamera camera;
        camsplat_plan_camera(plan, i, &camera, NULL);
        printf("%zu %.4f %.4f %.4f\n", i, camera.position[0], camera.position[1], camera.position[2]);
    }
}

#endif
