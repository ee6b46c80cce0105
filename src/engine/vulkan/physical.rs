//! Physical devices: what each has and what it lacks.

use std::fmt;

use ash::vk;

use super::instance::Instance;
use super::shaders::MOST_BUFFERS;
use crate::Result;

/// What the engine needs to know of a physical device.
#[derive(Clone, Debug, Default)]
pub struct Physical {
    pub(super) raw: vk::PhysicalDevice,
    /// Name as the driver gives it.
    pub name: String,
    /// Driver name and version.
    pub driver: String,
    /// What it calls itself.
    pub kind: Kind,
    /// Vulkan version (major, minor, patch).
    pub api: (u32, u32, u32),
    /// Threads in a subgroup.
    pub subgroup_size: u32,
    /// Fewest threads in a full subgroup of any shader: some drivers run narrower subgroups than they report.
    pub subgroup_smallest: u32,
    /// Threads in a full subgroup of every shader that has operations of subgroups; none where a driver chooses shader by shader.
    pub subgroup_width: Option<u32>,
    /// Bytes of shared memory a workgroup may use.
    pub shared_memory: u32,
    /// Bytes of push constants.
    pub push_constants: u32,
    /// Most bytes of a storage buffer that a shader can see.
    pub storage_range: u64,
    /// Most bytes of one allocation.
    pub allocation: u64,
    /// Bytes of the largest device-local heap.
    pub heap: u64,
    /// What an offset in a storage buffer is to be a multiple of, in bytes.
    pub storage_alignment: u64,
    /// Most workgroups of a dispatch along each axis.
    pub groups: [u32; 3],
    /// Most threads of a workgroup, along x too.
    pub threads: u32,
    /// Nanoseconds per timestamp tick.
    pub timestamp_period: f32,
    /// Bits of a timestamp that count; zero where the queue has none.
    pub timestamp_bits: u32,
    /// Whether shaders can add floats in buffers atomically.
    pub atomic_floats: bool,
    /// Whether a workgroup that has begun is known to run on while others wait for it in a loop. Nothing in Vulkan says so: true of NVIDIA's
    /// own driver with subgroups of 32 that add, where it was tried. lavapipe leaves loops after 65,535 turns.
    pub runs_begun_groups: bool,
    /// Whether shaders keep numbers that are none: without it some broken input may go unnoticed.
    pub keeps_nan: bool,
    /// What the engine needs and the device does not have; empty where it can be used.
    pub lacks: Vec<String>,
    pub(super) queue_family: u32,
    pub(super) checkpoints: bool,
    pub(super) memory_budget: bool,
    /// The width that shaders with operations of subgroups are to be compiled for, of a device that would choose itself.
    pub(super) asked_width: Option<u32>,
    /// Whether this is Vulkan by translation, whose extension must be enabled.
    pub(super) portability: bool,
    /// Bytes of device memory that were free when the device was read.
    pub(super) free: u64,
    pub(super) class: Class,
}

/// What a device calls itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// A GPU with memory of its own.
    DiscreteGpu,
    /// A GPU that shares the host's memory.
    IntegratedGpu,
    /// A GPU of a virtual machine.
    VirtualGpu,
    /// A processor that runs shaders in software, such as lavapipe.
    Cpu,
    /// None of these.
    #[default]
    Other,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::DiscreteGpu => "discrete GPU",
            Self::IntegratedGpu => "integrated GPU",
            Self::VirtualGpu => "virtual GPU",
            Self::Cpu => "CPU",
            Self::Other => "other",
        })
    }
}

/// Classes of devices, the ones to prefer first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Class {
    Discrete,
    Integrated,
    Virtual,
    /// A GPU through another interface (Direct3D under WSL2, a virtual machine's host): slower than its own driver, and its duplicate.
    Layered,
    /// A CPU, and what does not say what it is.
    #[default]
    Software,
}

/// Drivers of GPUs that translate for another driver. MoltenVK is none of them: macOS has no other.
const LAYERED: [vk::DriverId; 2] = [vk::DriverId::MESA_DOZEN, vk::DriverId::MESA_VENUS];

impl Physical {
    /// Whether it is software: few threads, each of which is slow to wait for others.
    pub fn is_cpu(&self) -> bool {
        self.kind == Kind::Cpu
    }

    /// Name and driver, for the user.
    pub fn title(&self) -> String {
        // Drivers that repeat the name say only their version beside it.
        let model = self.name.split(['(', ' ']).next().unwrap_or_default();
        let driver = self.driver.trim();
        let version = driver.strip_prefix(model).map_or(driver, str::trim);
        format!("{}; {version}", self.name)
    }

    /// Reads a device's properties.
    pub(super) fn read(instance: &Instance, raw: vk::PhysicalDevice) -> Self {
        let mut subgroup = vk::PhysicalDeviceSubgroupProperties::default();
        // Left at zero by drivers that do not support it.
        let mut subgroup_range = vk::PhysicalDeviceSubgroupSizeControlProperties::default();
        let mut driver = vk::PhysicalDeviceDriverProperties::default();
        let mut maintenance = vk::PhysicalDeviceMaintenance3Properties::default();
        let mut floats = vk::PhysicalDeviceFloatControlsProperties::default();
        // Left at zero by drivers without the extension, which cannot be used anyway.
        let mut push = vk::PhysicalDevicePushDescriptorPropertiesKHR::default();
        let mut properties = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut subgroup)
            .push_next(&mut subgroup_range)
            .push_next(&mut driver)
            .push_next(&mut maintenance)
            .push_next(&mut push)
            .push_next(&mut floats);
        // SAFETY: `raw` comes from this instance; the chained structs are core in Vulkan 1.2 and outlive the calls.
        let (families, extensions, memory) = unsafe {
            instance.raw.get_physical_device_properties2(raw, &mut properties);
            (
                instance.raw.get_physical_device_queue_family_properties(raw),
                instance.raw.enumerate_device_extension_properties(raw).unwrap_or_default(),
                instance.raw.get_physical_device_memory_properties(raw),
            )
        };
        let properties = properties.properties;
        let limits = properties.limits;
        let text =
            |name: Result<&std::ffi::CStr, _>| name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let has = |name| extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name));
        let (class, kind) = match properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => (Class::Discrete, Kind::DiscreteGpu),
            vk::PhysicalDeviceType::INTEGRATED_GPU => (Class::Integrated, Kind::IntegratedGpu),
            vk::PhysicalDeviceType::VIRTUAL_GPU => (Class::Virtual, Kind::VirtualGpu),
            vk::PhysicalDeviceType::CPU => (Class::Software, Kind::Cpu),
            _ => (Class::Software, Kind::Other),
        };
        let class = if LAYERED.contains(&driver.driver_id) { class.max(Class::Layered) } else { class };
        let family = compute_family(&families);
        let api = properties.api_version;
        let mut lacks = Vec::new();
        let mut need = |met: bool, what: &str| {
            if !met {
                lacks.push(what.to_owned());
            }
        };
        need(api >= vk::API_VERSION_1_2, "Vulkan 1.2");
        need(family.is_some(), "a compute queue");
        need(has(ash::khr::push_descriptor::NAME), "VK_KHR_push_descriptor");
        need(limits.max_push_constants_size >= 128, "128 bytes of push constants");
        let buffers = limits.max_per_stage_descriptor_storage_buffers.min(push.max_push_descriptors);
        need(buffers >= MOST_BUFFERS, &format!("{MOST_BUFFERS} storage buffers to a stage"));
        need(limits.max_compute_shared_memory_size >= 32 << 10, "32 KiB of shared memory");
        need(limits.max_compute_work_group_invocations >= 256, "workgroups of 256 threads");
        let operations = vk::SubgroupFeatureFlags::BASIC
            | vk::SubgroupFeatureFlags::VOTE
            | vk::SubgroupFeatureFlags::BALLOT
            | vk::SubgroupFeatureFlags::SHUFFLE;
        need(
            subgroup.supported_stages.contains(vk::ShaderStageFlags::COMPUTE)
                && subgroup.supported_operations.contains(operations)
                && (4..=128).contains(&subgroup.subgroup_size),
            "votes, ballots and shuffles of subgroups in compute",
        );
        let mut atomics = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default();
        if has(ash::ext::shader_atomic_float::NAME) {
            let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut atomics);
            // SAFETY: the device lists the extension whose struct is chained.
            unsafe { instance.raw.get_physical_device_features2(raw, &mut features) };
        }
        let mut sizes = vk::PhysicalDeviceSubgroupSizeControlFeatures::default();
        if has(ash::ext::subgroup_size_control::NAME) {
            let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut sizes);
            // SAFETY: as above.
            unsafe { instance.raw.get_physical_device_features2(raw, &mut features) };
        }
        let asked_width = asked_width(&subgroup_range, &sizes);
        let atomic_floats = atomics.shader_buffer_float32_atomic_add == vk::TRUE;
        let bits = family.map_or(0, |family| families[family].timestamp_valid_bits);
        let memory_budget = has(ash::ext::memory_budget::NAME);
        let heap = memory
            .memory_heaps_as_slice()
            .iter()
            .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
            .map(|heap| heap.size)
            .max()
            .unwrap_or(0);
        Self {
            raw,
            name: text(properties.device_name_as_c_str()),
            driver: format!("{} {}", text(driver.driver_name_as_c_str()), text(driver.driver_info_as_c_str())),
            kind,
            api: (vk::api_version_major(api), vk::api_version_minor(api), vk::api_version_patch(api)),
            subgroup_size: subgroup.subgroup_size,
            subgroup_smallest: match subgroup_range.min_subgroup_size {
                0 => subgroup.subgroup_size,
                smallest => smallest.max(4),
            },
            subgroup_width: match (subgroup_range.min_subgroup_size, subgroup_range.max_subgroup_size) {
                (0, _) => None,
                (smallest, largest) => (smallest == largest).then_some(smallest),
            }
            .or(asked_width),
            asked_width,
            shared_memory: limits.max_compute_shared_memory_size,
            push_constants: limits.max_push_constants_size,
            storage_range: limits.max_storage_buffer_range as u64,
            allocation: maintenance.max_memory_allocation_size,
            heap,
            free: if memory_budget { free_memory(instance, raw) } else { heap },
            threads: limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]),
            storage_alignment: limits.min_storage_buffer_offset_alignment.max(4),
            groups: limits.max_compute_work_group_count,
            timestamp_period: limits.timestamp_period,
            timestamp_bits: bits,
            atomic_floats,
            runs_begun_groups: driver.driver_id == vk::DriverId::NVIDIA_PROPRIETARY
                && subgroup.subgroup_size == 32
                && subgroup.supported_operations.contains(vk::SubgroupFeatureFlags::ARITHMETIC),
            keeps_nan: floats.shader_signed_zero_inf_nan_preserve_float32 == vk::TRUE,
            portability: has(ash::khr::portability_subset::NAME),
            lacks,
            queue_family: family.unwrap_or(0) as u32,
            checkpoints: has(ash::nv::device_diagnostic_checkpoints::NAME),
            memory_budget,
            class,
        }
    }

    /// Every device of an instance.
    ///
    /// # Errors
    /// Where there is no driver.
    pub fn all(instance: &Instance) -> Result<Vec<Self>> {
        Ok(instance.physical_devices()?.into_iter().map(|raw| Self::read(instance, raw)).collect())
    }
}

/// The queue family to compute on: one without graphics where there is one that keeps time, so that long work does not hold up what is drawn.
fn compute_family(families: &[vk::QueueFamilyProperties]) -> Option<usize> {
    let computes = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(vk::QueueFlags::COMPUTE);
    let aside = |family: &vk::QueueFamilyProperties| {
        computes(family) && !family.queue_flags.contains(vk::QueueFlags::GRAPHICS) && family.timestamp_valid_bits > 0
    };
    families.iter().position(aside).or_else(|| families.iter().position(computes))
}

/// 32 where that is the narrowest of a range, as on AMD's RDNA, whose drivers take 64 by themselves: stages share by shuffles among 32.
/// Where narrower ones exist, as on Intel's, 32 costs more registers than there are.
fn asked_width(
    range: &vk::PhysicalDeviceSubgroupSizeControlProperties<'_>,
    features: &vk::PhysicalDeviceSubgroupSizeControlFeatures<'_>,
) -> Option<u32> {
    let can = features.subgroup_size_control == vk::TRUE
        && features.compute_full_subgroups == vk::TRUE
        && range.required_subgroup_size_stages.contains(vk::ShaderStageFlags::COMPUTE);
    (can && range.min_subgroup_size == 32 && range.max_subgroup_size > 32).then_some(32)
}

/// Bytes that can still be taken of the device-local heap that has most, of a device with `VK_EXT_memory_budget`.
pub(super) fn free_memory(instance: &Instance, raw: vk::PhysicalDevice) -> u64 {
    let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
    let mut memory = vk::PhysicalDeviceMemoryProperties2::default().push_next(&mut budget);
    // SAFETY: the device is of this instance and lists the extension whose struct is chained.
    unsafe { instance.raw.get_physical_device_memory_properties2(raw, &mut memory) };
    let heaps = memory.memory_properties;
    let free = |i: usize| match budget.heap_budget[i] {
        // Some drivers list the extension and report nothing.
        0 => heaps.memory_heaps[i].size,
        budgeted => budgeted.saturating_sub(budget.heap_usage[i]),
    };
    (0..heaps.memory_heap_count as usize)
        .filter(|&i| heaps.memory_heaps[i].flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
        .map(free)
        .max()
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, AMD's GPUs would exchange through shared memory what shuffles do, or a driver would refuse pipelines.
    #[test]
    fn a_width_is_asked_for_where_32_is_the_narrowest_of_several() {
        let range = |smallest, largest| {
            let stages = vk::ShaderStageFlags::COMPUTE;
            let range =
                vk::PhysicalDeviceSubgroupSizeControlProperties::default().required_subgroup_size_stages(stages);
            range.min_subgroup_size(smallest).max_subgroup_size(largest)
        };
        let able = vk::PhysicalDeviceSubgroupSizeControlFeatures::default();
        let able = able.subgroup_size_control(true).compute_full_subgroups(true);
        let asked = |smallest, largest| asked_width(&range(smallest, largest), &able);
        // RDNA; GFX9; NVIDIA; Intel; lavapipe; a driver without the extension.
        let found = [asked(32, 64), asked(64, 64), asked(32, 32), asked(8, 32), asked(8, 8), asked(0, 0)];
        assert_eq!(found, [Some(32), None, None, None, None, None]);
        assert_eq!(asked_width(&range(32, 64), &able.compute_full_subgroups(false)), None);
        let no_stage = range(32, 64).required_subgroup_size_stages(vk::ShaderStageFlags::FRAGMENT);
        assert_eq!(asked_width(&no_stage, &able), None);
    }

    /// If this failed, a desktop would freeze while plans are made, or a device without timestamps on that queue would lose its times.
    #[test]
    fn work_goes_to_a_family_without_graphics_where_that_keeps_time() {
        let family = |flags, bits| vk::QueueFamilyProperties {
            queue_flags: flags,
            timestamp_valid_bits: bits,
            ..Default::default()
        };
        let (graphics, compute, transfer) =
            (vk::QueueFlags::GRAPHICS, vk::QueueFlags::COMPUTE, vk::QueueFlags::TRANSFER);
        let all = family(graphics | compute | transfer, 64);
        assert_eq!(compute_family(&[all, family(transfer, 64), family(compute | transfer, 64)]), Some(2));
        assert_eq!(compute_family(&[all, family(compute, 0)]), Some(0));
        assert_eq!(compute_family(&[family(graphics, 64), family(compute, 0)]), Some(1));
        assert_eq!(compute_family(&[family(graphics, 64)]), None);
    }
}
