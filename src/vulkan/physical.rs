//! Physical devices: what each has, what it lacks, and which one to take.

use ash::vk;

use super::instance::Instance;
use crate::{Error, Result};

/// Storage buffers of the stage that has the most, `photograph_baked`.
const STAGE_BUFFERS: u32 = 18;

/// NVIDIA's number at the PCI SIG.
const NVIDIA: u32 = 0x10de;

/// What the engine needs to know of a physical device.
#[derive(Clone, Debug)]
pub struct Physical {
    pub(super) raw: vk::PhysicalDevice,
    /// Name as the driver gives it.
    pub name: String,
    /// Driver name and version.
    pub driver: String,
    /// "discrete GPU", "CPU", ...
    pub kind: &'static str,
    /// Vulkan version (major, minor, patch).
    pub api: (u32, u32, u32),
    /// Threads in a subgroup.
    pub subgroup_size: u32,
    /// Fewest threads in a full subgroup of any shader: some drivers run narrower subgroups than they report.
    pub subgroup_smallest: u32,
    /// Threads in a full subgroup of every shader; none where a driver chooses shader by shader.
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
    /// Most workgroups of a dispatch along x.
    pub groups_x: u32,
    /// Most threads of a workgroup, along x too.
    pub threads: u32,
    /// Nanoseconds per timestamp tick; zero where the queue has no timestamps.
    pub timestamp_period: f32,
    /// Bits of a timestamp that count.
    pub timestamp_bits: u32,
    /// Whether shaders can add floats in buffers atomically.
    pub atomic_floats: bool,
    /// Whether a workgroup that has begun is known to run on while others wait for it in a loop. Nothing in Vulkan says so: true of NVIDIA's
    /// GPUs with subgroups of 32 that add, where it was tried. lavapipe leaves loops after 65,535 turns.
    pub runs_begun_groups: bool,
    /// What the engine needs and the device does not have; empty where it can be used.
    pub lacks: Vec<&'static str>,
    pub(super) queue_family: u32,
    pub(super) checkpoints: bool,
    pub(super) memory_budget: bool,
    /// Whether this is Vulkan by translation, whose extension must be enabled.
    pub(super) portability: bool,
    rank: u32,
}

impl Physical {
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
        let mut properties = vk::PhysicalDeviceProperties2::default()
            .push_next(&mut subgroup)
            .push_next(&mut subgroup_range)
            .push_next(&mut driver)
            .push_next(&mut maintenance);
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
        let (rank, kind) = match properties.device_type {
            vk::PhysicalDeviceType::DISCRETE_GPU => (0, "discrete GPU"),
            vk::PhysicalDeviceType::INTEGRATED_GPU => (1, "integrated GPU"),
            vk::PhysicalDeviceType::VIRTUAL_GPU => (2, "virtual GPU"),
            vk::PhysicalDeviceType::CPU => (3, "CPU"),
            _ => (4, "other"),
        };
        let family = families.iter().position(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE));
        let api = properties.api_version;
        let mut lacks = Vec::new();
        let mut need = |met: bool, what| {
            if !met {
                lacks.push(what);
            }
        };
        need(api >= vk::API_VERSION_1_2, "Vulkan 1.2");
        need(family.is_some(), "a compute queue");
        need(has(ash::khr::push_descriptor::NAME), "VK_KHR_push_descriptor");
        need(limits.max_push_constants_size >= 128, "128 bytes of push constants");
        need(limits.max_per_stage_descriptor_storage_buffers >= STAGE_BUFFERS, "18 storage buffers to a stage");
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
        let mut floats = vk::PhysicalDeviceShaderAtomicFloatFeaturesEXT::default();
        if has(ash::ext::shader_atomic_float::NAME) {
            let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut floats);
            // SAFETY: the device lists the extension whose struct is chained.
            unsafe { instance.raw.get_physical_device_features2(raw, &mut features) };
        }
        let atomic_floats = floats.shader_buffer_float32_atomic_add == vk::TRUE;
        let bits = family.map_or(0, |family| families[family].timestamp_valid_bits);
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
            },
            shared_memory: limits.max_compute_shared_memory_size,
            push_constants: limits.max_push_constants_size,
            storage_range: limits.max_storage_buffer_range as u64,
            allocation: maintenance.max_memory_allocation_size,
            heap: memory
                .memory_heaps_as_slice()
                .iter()
                .filter(|heap| heap.flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL))
                .map(|heap| heap.size)
                .max()
                .unwrap_or(0),
            threads: limits.max_compute_work_group_invocations.min(limits.max_compute_work_group_size[0]),
            groups_x: limits.max_compute_work_group_count[0],
            timestamp_period: if bits > 0 { limits.timestamp_period } else { 0.0 },
            timestamp_bits: bits,
            atomic_floats,
            runs_begun_groups: properties.vendor_id == NVIDIA
                && subgroup.subgroup_size == 32
                && subgroup.supported_operations.contains(vk::SubgroupFeatureFlags::ARITHMETIC),
            portability: has(ash::khr::portability_subset::NAME),
            lacks,
            queue_family: family.unwrap_or(0) as u32,
            checkpoints: has(ash::nv::device_diagnostic_checkpoints::NAME),
            memory_budget: has(ash::ext::memory_budget::NAME),
            rank,
        }
    }

    /// Every device of an instance.
    ///
    /// # Errors
    /// Where there is no driver.
    pub fn all(instance: &Instance) -> Result<Vec<Self>> {
        Ok(instance.physical_devices()?.into_iter().map(|raw| Self::read(instance, raw)).collect())
    }

    /// The device selected by index or by a part of its name; by default, the best that can be used
    /// (discrete before integrated before virtual before CPU).
    ///
    /// # Errors
    /// Where no device matches, or the one that does lacks something; the message names it.
    pub(super) fn choose(instance: &Instance, wanted: Option<&str>) -> Result<Self> {
        let devices = Self::all(instance)?;
        let names = || {
            let list: Vec<String> = devices.iter().enumerate().map(|(i, d)| format!("{i}: {}", d.name)).collect();
            list.join(", ")
        };
        let chosen = match wanted {
            Some(wanted) => {
                let lower = wanted.to_lowercase();
                let found = match wanted.parse::<usize>() {
                    Ok(index) => devices.get(index),
                    Err(_) => devices.iter().find(|device| device.name.to_lowercase().contains(&lower)),
                };
                found.ok_or_else(|| {
                    Error::NoDevice(format!("no device {wanted:?}; there is {} (see `camsplat devices`)", names()))
                })?
            }
            None => {
                devices.iter().filter(|device| device.lacks.is_empty()).min_by_key(|device| device.rank).ok_or_else(
                    || {
                        Error::NoDevice(format!(
                            "no device can be used ({}); `camsplat devices` says what each lacks",
                            names()
                        ))
                    },
                )?
            }
        };
        if chosen.lacks.is_empty() {
            Ok(chosen.clone())
        } else {
            Err(Error::NoDevice(format!("{} lacks {}", chosen.name, chosen.lacks.join(", "))))
        }
    }
}
