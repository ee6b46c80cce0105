// Compiles compute pipelines with the Vulkan driver that the loader finds, and prints what it reports of each. No dispatch takes place,
// so that a driver without hardware will do (RADV with RADV_FORCE_FAMILY, ANV with intel_device.c).
//
//   pipelines WIDTH <LIST
//
// WIDTH is the required subgroup size, 0 for the driver's choice. A line of LIST has, between tabs: label, SPIR-V file, number of storage
// buffers, bytes of push constants, threads of a workgroup, 1 where floats are added atomically, and specialisation constants (number=value,
// between spaces). A line of the output has: label, "ok" or what failed, subgroup size, and each statistic as name=value; pipelines with
// atomic floats are left out where the device has none. The first line has device and driver, or why there is none. Exit status: 0, 1 where
// a pipeline failed, 3 where the device cannot be used this way.

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vulkan/vulkan.h>

enum { MAX_BINDINGS = 64, MAX_CONSTANTS = 16, MAX_STATISTICS = 64 };

static VkInstance instance;
static VkPhysicalDevice physical;
static VkDevice device;
static int atomic_floats;
static PFN_vkGetPipelineExecutablePropertiesKHR get_properties;
static PFN_vkGetPipelineExecutableStatisticsKHR get_statistics;

static void unusable(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vprintf(format, arguments);
    va_end(arguments);
    puts("");
    exit(3);
}

// Opens the first device, with statistics of pipelines and, for a width, with control of the subgroup size.
static void open_device(unsigned width) {
    VkApplicationInfo application = {VK_STRUCTURE_TYPE_APPLICATION_INFO, .apiVersion = VK_API_VERSION_1_3};
    VkInstanceCreateInfo instance_info = {VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &application};
    uint32_t count = 1;
    if (vkCreateInstance(&instance_info, NULL, &instance) != VK_SUCCESS) unusable("no Vulkan driver");
    if (vkEnumeratePhysicalDevices(instance, &count, &physical) < 0 || count == 0) unusable("no Vulkan device");

    VkPhysicalDeviceVulkan13Properties sizes = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_PROPERTIES};
    VkPhysicalDeviceVulkan12Properties driver = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_PROPERTIES, &sizes};
    VkPhysicalDeviceProperties2 properties = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &driver};
    vkGetPhysicalDeviceProperties2(physical, &properties);
    if (properties.properties.apiVersion < VK_API_VERSION_1_3) unusable("%s has no Vulkan 1.3", properties.properties.deviceName);
    int within = sizes.minSubgroupSize <= width && width <= sizes.maxSubgroupSize;
    if (width && !(within && sizes.requiredSubgroupSizeStages & VK_SHADER_STAGE_COMPUTE_BIT))
        unusable("subgroups of %u to %u threads, none of %u", sizes.minSubgroupSize, sizes.maxSubgroupSize, width);

    VkPhysicalDevicePipelineExecutablePropertiesFeaturesKHR statistics = {
        VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PIPELINE_EXECUTABLE_PROPERTIES_FEATURES_KHR};
    VkPhysicalDeviceShaderAtomicFloatFeaturesEXT floats = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_ATOMIC_FLOAT_FEATURES_EXT, &statistics};
    VkPhysicalDeviceFeatures2 all = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &floats};
    vkGetPhysicalDeviceFeatures2(physical, &all);
    atomic_floats = floats.shaderBufferFloat32AtomicAdd;

    // What the engine enables, and what the statistics and the subgroup size need.
    VkPhysicalDeviceVulkan13Features sized = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES,
                                              .subgroupSizeControl = VK_TRUE, .computeFullSubgroups = VK_TRUE};
    VkPhysicalDeviceShaderAtomicFloatFeaturesEXT adds = {VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SHADER_ATOMIC_FLOAT_FEATURES_EXT,
                                                         .shaderBufferFloat32AtomicAdd = VK_TRUE};
    const char *names[3] = {VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME};
    uint32_t enabled = 1;
    void **next = &sized.pNext;
    if (statistics.pipelineExecutableInfo) {
        names[enabled++] = VK_KHR_PIPELINE_EXECUTABLE_PROPERTIES_EXTENSION_NAME;
        statistics.pNext = NULL;
        *next = &statistics;
        next = &statistics.pNext;
    }
    if (atomic_floats) {
        names[enabled++] = VK_EXT_SHADER_ATOMIC_FLOAT_EXTENSION_NAME;
        *next = &adds;
    }
    float priority = 1;
    VkDeviceQueueCreateInfo queue = {VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO, .queueCount = 1, .pQueuePriorities = &priority};
    VkDeviceCreateInfo info = {VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &sized, .queueCreateInfoCount = 1, .pQueueCreateInfos = &queue,
                               .enabledExtensionCount = enabled, .ppEnabledExtensionNames = names};
    VkResult made = vkCreateDevice(physical, &info, NULL, &device);
    if (made != VK_SUCCESS) unusable("%s: vkCreateDevice: %d", properties.properties.deviceName, made);
    if (statistics.pipelineExecutableInfo) {
        get_properties = (PFN_vkGetPipelineExecutablePropertiesKHR)vkGetDeviceProcAddr(device, "vkGetPipelineExecutablePropertiesKHR");
        get_statistics = (PFN_vkGetPipelineExecutableStatisticsKHR)vkGetDeviceProcAddr(device, "vkGetPipelineExecutableStatisticsKHR");
    }
    printf("%s\t%s\t%u-%u\n", properties.properties.deviceName, driver.driverInfo, sizes.minSubgroupSize, sizes.maxSubgroupSize);
    fflush(stdout);
}

static void print_statistics(VkPipeline pipeline) {
    VkPipelineInfoKHR info = {VK_STRUCTURE_TYPE_PIPELINE_INFO_KHR, .pipeline = pipeline};
    VkPipelineExecutablePropertiesKHR executable = {VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_PROPERTIES_KHR};
    VkPipelineExecutableInfoKHR first = {VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_INFO_KHR, .pipeline = pipeline};
    VkPipelineExecutableStatisticKHR statistics[MAX_STATISTICS];
    uint32_t one = 1, count = MAX_STATISTICS;
    for (int i = 0; i < MAX_STATISTICS; i++)
        statistics[i] = (VkPipelineExecutableStatisticKHR){VK_STRUCTURE_TYPE_PIPELINE_EXECUTABLE_STATISTIC_KHR};
    get_properties(device, &info, &one, &executable);
    get_statistics(device, &first, &count, statistics);
    printf("\t%u", executable.subgroupSize);
    for (uint32_t i = 0; i < count; i++) printf("\t%s=%llu", statistics[i].name, (unsigned long long)statistics[i].value.u64);
}

static uint32_t *read_file(const char *path, size_t *bytes) {
    FILE *file = fopen(path, "rb");
    if (!file) unusable("cannot read %s", path);
    fseek(file, 0, SEEK_END);
    *bytes = (size_t)ftell(file);
    rewind(file);
    uint32_t *words = malloc(*bytes);
    if (fread(words, 1, *bytes, file) != *bytes) unusable("cannot read %s", path);
    fclose(file);
    return words;
}

// Compiles one line's pipeline as the engine does: storage buffers from 0 on in a set of push descriptors, one range of push constants.
static int compile(unsigned width, const char *path, unsigned buffers, unsigned push_bytes, unsigned threads, char *constants) {
    VkDescriptorSetLayoutBinding bindings[MAX_BINDINGS];
    for (unsigned i = 0; i < buffers; i++)
        bindings[i] = (VkDescriptorSetLayoutBinding){i, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, NULL};
    VkDescriptorSetLayoutCreateInfo set_info = {VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO, NULL,
                                                VK_DESCRIPTOR_SET_LAYOUT_CREATE_PUSH_DESCRIPTOR_BIT_KHR, buffers, bindings};
    VkPushConstantRange range = {VK_SHADER_STAGE_COMPUTE_BIT, 0, push_bytes};
    VkDescriptorSetLayout set;
    VkPipelineLayout layout;
    VkShaderModule module;
    VkPipeline pipeline;
    size_t bytes;
    uint32_t *words = read_file(path, &bytes);
    VkPipelineLayoutCreateInfo layout_info = {VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO, .setLayoutCount = 1, .pSetLayouts = &set,
                                              .pushConstantRangeCount = push_bytes > 0, .pPushConstantRanges = &range};
    VkShaderModuleCreateInfo module_info = {VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO, .codeSize = bytes, .pCode = words};
    if (vkCreateDescriptorSetLayout(device, &set_info, NULL, &set) || vkCreatePipelineLayout(device, &layout_info, NULL, &layout) ||
        vkCreateShaderModule(device, &module_info, NULL, &module)) {
        puts("\tlayout or module refused");
        return 1;
    }
    VkSpecializationMapEntry entries[MAX_CONSTANTS];
    uint32_t values[MAX_CONSTANTS], count = 0;
    for (char *one = strtok(constants, " \n"); one && count < MAX_CONSTANTS; one = strtok(NULL, " \n"), count++) {
        entries[count] = (VkSpecializationMapEntry){(uint32_t)strtoul(one, &one, 10), 4 * count, 4};
        values[count] = (uint32_t)strtoul(one + 1, NULL, 10);
    }
    VkSpecializationInfo special = {count, entries, 4 * count, values};
    VkPipelineShaderStageRequiredSubgroupSizeCreateInfo size = {
        VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_REQUIRED_SUBGROUP_SIZE_CREATE_INFO, NULL, width};
    VkPipelineShaderStageCreateFlags full = width && threads % width == 0 ? VK_PIPELINE_SHADER_STAGE_CREATE_REQUIRE_FULL_SUBGROUPS_BIT : 0;
    VkComputePipelineCreateInfo info = {
        VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO, NULL, get_statistics ? VK_PIPELINE_CREATE_CAPTURE_STATISTICS_BIT_KHR : 0,
        {VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO, width ? &size : NULL, full, VK_SHADER_STAGE_COMPUTE_BIT, module, "main", &special},
        layout, VK_NULL_HANDLE, 0};
    VkResult made = vkCreateComputePipelines(device, VK_NULL_HANDLE, 1, &info, NULL, &pipeline);
    if (made == VK_SUCCESS) {
        printf("\tok");
        if (get_statistics) print_statistics(pipeline);
        puts("");
        vkDestroyPipeline(device, pipeline, NULL);
    } else {
        printf("\tvkCreateComputePipelines: %d\n", made);
    }
    vkDestroyShaderModule(device, module, NULL);
    vkDestroyPipelineLayout(device, layout, NULL);
    vkDestroyDescriptorSetLayout(device, set, NULL);
    free(words);
    return made != VK_SUCCESS;
}

int main(int count, char **arguments) {
    unsigned width = count == 2 ? (unsigned)strtoul(arguments[1], NULL, 10) : 0;
    open_device(width);
    char line[4096], label[256], path[2048], constants[1024];
    int failed = 0;
    while (fgets(line, sizeof line, stdin)) {
        unsigned buffers, push_bytes, threads;
        int floats;
        constants[0] = 0;
        if (sscanf(line, "%255[^\t]\t%2047[^\t]\t%u\t%u\t%u\t%d\t%1023[^\n]", label, path, &buffers, &push_bytes, &threads, &floats,
                   constants) < 6)
            unusable("not a line of the list: %s", line);
        if (floats && !atomic_floats) continue;
        // At once, so that a driver that crashes has named the pipeline.
        printf("%s", label);
        fflush(stdout);
        failed |= compile(width, path, buffers, push_bytes, threads, constants);
        fflush(stdout);
    }
    vkDestroyDevice(device, NULL);
    vkDestroyInstance(instance, NULL);
    return failed;
}
