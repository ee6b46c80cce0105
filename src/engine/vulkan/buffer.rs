//! Buffers: named, sized, allocated once.

use std::ffi::CString;
use std::sync::Arc;

use ash::vk;
use bytemuck::{AnyBitPattern, NoUninit};
use gpu_allocator::MemoryLocation;
use gpu_allocator::vulkan::{Allocation, AllocationCreateDesc, AllocationScheme};

use super::context::Context;
use super::kept::LastKept;
use super::mapping::Mapping;
use crate::engine::parallel::lock;
use crate::{Error, Result};

/// A storage buffer on the device, from which a host application may draw too (as vertices, indices or uniforms). What is recorded with it
/// keeps it in memory until it has run, also where the buffer is dropped before.
pub struct Buffer {
    pub(super) memory: Arc<Memory>,
}

/// A Vulkan buffer, or a part of a host application's, and the memory it is bound to.
pub(super) struct Memory {
    pub(super) raw: vk::Buffer,
    pub(super) offset: u64,
    pub(super) usage: vk::BufferUsageFlags,
    owned: bool,
    allocation: Option<Allocation>,
    mapping: Option<Mapping>,
    size: u64,
    name: String,
    on_device: bool,
    pub(super) last_kept: LastKept,
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
        // Vulkan has no empty buffers; a stage that sees none of its elements may still be bound to one. Fills are of whole words.
        let size = size.max(16).next_multiple_of(4);
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
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::VERTEX_BUFFER
            | vk::BufferUsageFlags::INDEX_BUFFER
            | vk::BufferUsageFlags::UNIFORM_BUFFER;
        let info = vk::BufferCreateInfo::default().size(size).usage(usage);
        // SAFETY: `info` is valid for this device, whose limits were checked above.
        let raw = unsafe { context.device.create_buffer(&info, None) }
            .map_err(|code| context.failure("vkCreateBuffer", code))?;
        let on_device = location == MemoryLocation::GpuOnly;
        // From here on dropping `memory` frees what there is.
        let mut memory = Memory {
            raw,
            offset: 0,
            usage,
            owned: true,
            allocation: None,
            mapping: None,
            size,
            name: name.to_owned(),
            on_device,
            last_kept: LastKept::default(),
            context: context.clone(),
        };
        // SAFETY: `raw` is live.
        let requirements = unsafe { context.device.get_buffer_memory_requirements(raw) };
        let allocated = lock(&context.allocator).allocate(&AllocationCreateDesc {
            name,
            requirements,
            location,
            linear: true,
            allocation_scheme: AllocationScheme::GpuAllocatorManaged,
        });
        let allocation = allocated.map_err(|_| out_of_memory(context.memory_available()))?;
        // SAFETY: the allocation was made for this buffer's requirements and is bound once. It is freed with `memory` also where this fails.
        let bound = unsafe { context.device.bind_buffer_memory(raw, allocation.memory(), allocation.offset()) };
        // Some devices map all they have; nobody is to rely on that.
        let mapped = allocation.mapped_ptr().filter(|_| !on_device);
        // SAFETY: the mapping has at least `size` bytes at an alignment that Vulkan requires to be four or more, and lives as long as the
        // allocation; only `Mapping` uses it.
        memory.mapping = mapped.map(|start| unsafe { Mapping::new(start.cast(), size as usize) });
        memory.allocation = Some(allocation);
        if on_device {
            context.count_allocated(size);
        }
        bound.map_err(|code| context.failure("vkBindBufferMemory", code))?;
        if let Ok(label) = CString::new(name) {
            context.name(raw, &label);
        }
        Ok(Self { memory: Arc::new(memory) })
    }

    /// A part of a host application's buffer, so that stages read and write there without a copy: `size` bytes from byte `offset` on.
    /// `usage` is what the host made the buffer with. The host orders its own use of the part and the engine's: by barriers within a
    /// command buffer that it lends ([`Recorder::host`]), by timeline semaphores or by waiting otherwise.
    ///
    /// # Safety
    /// `raw` must be of the context's device, made with `usage`, bound to memory, hold the part, and live until this buffer is dropped and
    /// everything recorded with it has run.
    ///
    /// # Errors
    /// Where stages could not use the part: a usage that is missing (`STORAGE_BUFFER`, `TRANSFER_SRC`, `TRANSFER_DST`), an offset that the
    /// device does not take, or a size that is zero, no multiple of four or more than a shader can see.
    ///
    /// [`Recorder::host`]: super::Recorder::host
    pub unsafe fn wrap(
        context: &Arc<Context>,
        name: &str,
        raw: vk::Buffer,
        usage: vk::BufferUsageFlags,
        [offset, size]: [u64; 2],
    ) -> Result<Self> {
        let refused = |what: String| Err(Error::Request(format!("the buffer {name:?} cannot be used: {what}")));
        let physical = context.physical();
        let needed = vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST;
        if !usage.contains(needed) {
            return refused(format!("it was made without {:?}", needed & !usage));
        }
        if !offset.is_multiple_of(physical.storage_alignment) {
            return refused(format!("offset {offset} is no multiple of {}", physical.storage_alignment));
        }
        if size == 0 || !size.is_multiple_of(4) || size > physical.storage_range {
            let most = physical.storage_range;
            return refused(format!("{size} bytes are not a multiple of four from 4 to {most}"));
        }
        let memory = Memory {
            raw,
            offset,
            usage,
            owned: false,
            allocation: None,
            mapping: None,
            size,
            name: name.to_owned(),
            on_device: false,
            last_kept: LastKept::default(),
            context: context.clone(),
        };
        Ok(Self { memory: Arc::new(memory) })
    }

    /// Where in [`Buffer::handle`] the buffer begins, in bytes: 0 but in what [`Buffer::wrap`] made.
    pub fn offset(&self) -> u64 {
        self.memory.offset
    }

    /// The context whose device the buffer is on.
    pub(super) fn context(&self) -> &Arc<Context> {
        &self.memory.context
    }

    /// Size in bytes.
    pub fn size(&self) -> u64 {
        self.memory.size
    }

    /// Name, as capture tools show it.
    pub fn name(&self) -> &str {
        &self.memory.name
    }

    /// The Vulkan buffer, for stages of a host application's own, of which the host may destroy nothing; it lives while this does. All of
    /// it but in what [`Buffer::wrap`] made. Bindings other than ash's take `ash::vk::Handle::as_raw` of it.
    pub fn handle(&self) -> vk::Buffer {
        self.memory.raw
    }

    /// Copies the first `count` elements of a host buffer. What the device has written is there once the submission that wrote it has
    /// been waited for.
    ///
    /// # Errors
    /// Where the buffer holds fewer elements, or is a device buffer.
    pub fn read<T: AnyBitPattern + NoUninit>(&self, count: usize) -> Result<Vec<T>> {
        let mut values = vec![T::zeroed(); count];
        self.read_into(&mut values)?;
        Ok(values)
    }

    /// The same, into `values`.
    ///
    /// # Errors
    /// As for [`Buffer::read`].
    pub fn read_into<T: AnyBitPattern + NoUninit>(&self, values: &mut [T]) -> Result<()> {
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(values);
        let wanted = bytes.len();
        match self.memory.mapping.as_ref().is_some_and(|mapping| mapping.read(0, bytes)) {
            true => Ok(()),
            false => Err(Error::Request(format!("{wanted} bytes cannot be read from the buffer {:?}", self.name()))),
        }
    }

    /// Reads one `u32` of a host buffer while the device may be writing it; `None` outside the buffer.
    pub fn peek(&self, index: usize) -> Option<u32> {
        self.memory.mapping.as_ref()?.peek(index)
    }

    /// Writes one `u32` of a host buffer while the device may be reading it; does nothing outside the buffer.
    pub fn poke(&self, index: usize, value: u32) {
        if let Some(mapping) = &self.memory.mapping {
            mapping.poke(index, value);
        }
    }

    /// Writes `data` to the start of a host buffer. A submission that is running must not read it meanwhile.
    ///
    /// # Errors
    /// Where `data` is larger than the buffer, or the buffer is a device buffer.
    pub fn write<T: NoUninit>(&self, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        match self.memory.mapping.as_ref().is_some_and(|mapping| mapping.write(0, bytes)) {
            true => Ok(()),
            false => {
                Err(Error::Request(format!("{} bytes cannot be written to the buffer {:?}", bytes.len(), self.name())))
            }
        }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        if self.owned {
            // SAFETY: whatever was recorded with the buffer holds this memory until it has run.
            unsafe { self.context.device.destroy_buffer(self.raw, None) };
        }
        if let Some(allocation) = self.allocation.take() {
            if self.on_device {
                self.context.count_freed(self.size);
            }
            // A failure to free cannot be acted on in a destructor; the device's memory goes with the context.
            let _ = lock(&self.context.allocator).free(allocation);
        }
    }
}
