//! Buffers: named, sized, allocated once.

use std::ffi::CString;
use std::sync::Arc;

use ash::vk;
use bytemuck::NoUninit;
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::context::Context;
use crate::parallel::lock;
use crate::{Error, Result};

/// A storage buffer on the device.
pub struct Buffer {
    pub(super) raw: vk::Buffer,
    pub(super) allocation: Option<Allocation>,
    pub(super) size: u64,
    pub(super) name: String,
    on_device: bool,
    pub(super) context: Arc<Context>,
}

impl Buffer {
    /// A buffer of `size` bytes in device memory, contents undefined.
    ///
    /// # Errors
    /// Where the device has too little memory left, or no shader could see so large a buffer.
    pub fn device(context: &Arc<Context>, name: &str, size: u64) -> Result<Self> {
        Self::new(context, name, size, MemoryLocation::GpuOnly)
    }

    /// A buffer of `size` bytes that the host can read and write while the device does.
    ///
    /// # Errors
    /// As for [`Buffer::device`].
    pub fn host(context: &Arc<Context>, name: &str, size: u64) -> Result<Self> {
        Self::new(context, name, size, MemoryLocation::GpuToCpu)
    }

    pub(super) fn new(context: &Arc<Context>, name: &str, size: u64, location: MemoryLocation) -> Result<Self> {
        // Vulkan has no empty buffers; a stage that sees none of its elements may still be bound to one.
        let size = size.max(16);
        let physical = context.physical();
        let limit = physical.storage_range.min(physical.allocation);
        let out_of_memory = |available| Error::OutOfMemory {
            what: format!("the buffer {name:?}"),
            wanted: size,
            available,
            remedy: "ask for less, or take a larger device".into(),
        };
        if size > limit {
            return Err(out_of_memory(limit));
        }
        let usage = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST
            | vk::BufferUsageFlags::INDIRECT_BUFFER;
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: `info` is valid for this device, whose limits were checked above.
        let raw = unsafe { context.device.create_buffer(&info, None) }
            .map_err(|code| context.failure("vkCreateBuffer", code))?;
        // SAFETY: `raw` is live.
        let requirements = unsafe { context.device.get_buffer_memory_requirements(raw) };
        let allocated = lock(&context.allocator).allocate(&AllocationCreateDesc {
            name,
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        });
        let allocation = match allocated {
            Ok(allocation) => allocation,
            Err(_) => {
                // SAFETY: nothing uses the buffer yet.
                unsafe { context.device.destroy_buffer(raw, None) };
                return Err(out_of_memory(context.memory_available()));
            }
        };
        let on_device = location == MemoryLocation::GpuOnly;
        let allocation = Some(allocation);
        let buffer = Self { raw, allocation, size, name: name.to_owned(), on_device, context: context.clone() };
        buffer.count(Context::count_allocated);
        if let Some(allocation) = &buffer.allocation {
            // SAFETY: the allocation was made for this buffer's requirements and is bound once. On failure dropping
            // `buffer` frees both.
            unsafe { context.device.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) }
                .map_err(|code| context.failure("vkBindBufferMemory", code))?;
        }
        if let Ok(label) = CString::new(name) {
            context.name(raw, &label);
        }
        Ok(buffer)
    }

    /// Counts the bytes of a buffer in device memory.
    fn count(&self, how: impl Fn(&Context, u64)) {
        if self.on_device {
            how(&self.context, self.size);
        }
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Name, as capture tools show it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The Vulkan buffer, for stages of a host application's own; of the buffer and what is bound in it nothing may be destroyed.
    /// Bindings other than ash's take `ash::vk::Handle::as_raw` of it.
    pub fn handle(&self) -> vk::Buffer {
        self.raw
    }

    /// The bytes of a host buffer (empty for a device buffer). What the device has written is there once the
    /// submission that wrote it has been waited for.
    pub fn mapped(&self) -> &[u8] {
        let bytes = self.allocation.as_ref().and_then(Allocation::mapped_slice).unwrap_or_default();
        &bytes[..bytes.len().min(self.size as usize)]
    }

    /// Reads one `u32` of a host buffer while the device may be writing it; `None` outside the buffer.
    pub fn peek(&self, index: usize) -> Option<u32> {
        let pointer = self.word(index)?;
        // SAFETY: `word` points at an aligned word of this buffer's mapping.
        Some(unsafe { pointer.read_volatile() })
    }

    /// Writes one `u32` of a host buffer while the device may be reading it; does nothing outside the buffer.
    pub fn poke(&self, index: usize, value: u32) {
        if let Some(pointer) = self.word(index) {
            // SAFETY: as in `peek`.
            unsafe { pointer.write_volatile(value) };
        }
    }

    /// Writes `data` to the start of a host buffer. A submission that is running must not read it meanwhile.
    ///
    /// # Errors
    /// Where `data` is larger than the buffer, or the buffer is a device buffer.
    pub fn write<T: NoUninit>(&self, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let mapped = self.allocation.as_ref().and_then(Allocation::mapped_ptr);
        let Some(target) = mapped.filter(|_| bytes.len() as u64 <= self.size) else {
            return Err(Error::Request(format!(
                "{} bytes cannot be written to the buffer {:?}",
                bytes.len(),
                self.name
            )));
        };
        // SAFETY: the mapping has at least `self.size` bytes.
        unsafe { std::ptr::copy(bytes.as_ptr(), target.as_ptr().cast::<u8>(), bytes.len()) };
        Ok(())
    }

    fn word(&self, index: usize) -> Option<*mut u32> {
        let pointer = self.allocation.as_ref()?.mapped_ptr()?.as_ptr().cast::<u32>();
        // SAFETY: the word lies inside the mapping, whose size is at least `self.size`.
        ((index as u64).checked_add(1).and_then(|n| n.checked_mul(4)).is_some_and(|end| end <= self.size))
            .then(|| unsafe { pointer.add(index) })
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        // SAFETY: recorders wait for their submissions before they release the buffers that they use.
        unsafe { self.context.device.destroy_buffer(self.raw, None) };
        if let Some(allocation) = self.allocation.take() {
            self.count(Context::count_freed);
            // A failure to free cannot be acted on in a destructor; the device's memory goes with the context.
            let _ = lock(&self.context.allocator).free(allocation);
        }
    }
}
