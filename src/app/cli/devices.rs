//! `camsplat devices`.

use super::session::Ended;
use crate::Result;
use crate::engine::vulkan::instance::Instance;
use crate::engine::vulkan::physical::Physical;
use crate::planner::plan::paper;

/// Lists every device.
pub fn run() -> Result<Ended> {
    let instance = Instance::new(false)?;
    for (index, device) in Physical::all(&instance)?.iter().enumerate() {
        let (major, minor, patch) = device.api;
        say!("{index}: {} ({}, Vulkan {major}.{minor}.{patch}, {})", device.name, device.kind, device.driver.trim());
        say!(
            "   subgroups of {}, {} KiB shared, {} bytes of push constants, timestamps of {} bits",
            device.subgroup_size,
            device.shared_memory >> 10,
            device.push_constants,
            device.timestamp_bits
        );
        say!(
            "   {} MiB of device memory, allocations up to {} MiB, buffers up to {} MiB",
            device.heap >> 20,
            device.allocation >> 20,
            device.storage_range >> 20
        );
        if device.lacks.is_empty() {
            if !device.keeps_nan {
                say!("   may lose numbers that are none, so that some broken input goes unnoticed");
            }
            say!("   largest plan with 200 probes a step: about {} views", paper::largest(device, 200));
        } else {
            say!("   cannot be used: lacks {}", device.lacks.join(", "));
        }
    }
    Ok(Ended::Done)
}
