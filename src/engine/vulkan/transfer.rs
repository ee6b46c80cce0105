//! Copies between the host and buffers on the device, through staging memory.

use std::sync::Arc;

use bytemuck::{AnyBitPattern, NoUninit};
use gpu_allocator::MemoryLocation;

use super::buffer::Buffer;
use super::context::Context;
use super::recorder::Recorder;
use crate::{Error, Result};

/// Bytes of a staging buffer at most: larger transfers go through it part by part.
const STAGING: usize = 32 << 20;

impl Buffer {
    /// A device buffer that holds `data`.
    ///
    /// # Errors
    /// As for [`Buffer::device`].
    pub fn from_slice<T: NoUninit>(context: &Arc<Context>, name: &str, data: &[T]) -> Result<Self> {
        let buffer = Self::device(context, name, size_of_val(data) as u64)?;
        buffer.upload(data)?;
        Ok(buffer)
    }

    /// Copies `data` to the start of the buffer and waits for it.
    ///
    /// # Errors
    /// Where `data` is larger than the buffer, or the device fails.
    pub fn upload<T: NoUninit>(&self, data: &[T]) -> Result<()> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        if bytes.len() as u64 > self.size() {
            return Err(Error::Request(format!("{} bytes do not fit the buffer {:?}", bytes.len(), self.name())));
        }
        if bytes.is_empty() {
            return Ok(());
        }
        let longest = bytes.len().min(STAGING);
        let staging = Buffer::new(self.context(), "staging", longest as u64, MemoryLocation::CpuToGpu)?;
        for (i, part) in bytes.chunks(longest).enumerate() {
            staging.write(part)?;
            let mut commands = Recorder::new(self.context())?;
            commands.copy_region(&staging, 0, self, (i * longest) as u64, part.len() as u64);
            commands.submit_and_wait()?;
        }
        Ok(())
    }

    /// Copies the first `count` elements back and waits for them.
    ///
    /// # Errors
    /// Where the buffer holds fewer elements, or the device fails.
    pub fn download<T: AnyBitPattern + NoUninit>(&self, count: usize) -> Result<Vec<T>> {
        self.download_from(0, count)
    }

    /// Copies `count` elements back, from element `first` on, and waits for them.
    ///
    /// # Errors
    /// As for [`Buffer::download`].
    pub fn download_from<T: AnyBitPattern + NoUninit>(&self, first: usize, count: usize) -> Result<Vec<T>> {
        let [begin, bytes] = [first, count].map(|n| (n as u64).saturating_mul(size_of::<T>() as u64));
        if begin.saturating_add(bytes) > self.size() {
            return Err(Error::Request(format!("{bytes} bytes are more than the buffer {:?} holds", self.name())));
        }
        if count == 0 {
            return Ok(Vec::new());
        }
        let longest = bytes.min(STAGING as u64);
        let staging = Buffer::new(self.context(), "staging", longest, MemoryLocation::GpuToCpu)?;
        let mut values: Vec<T> = vec![T::zeroed(); count];
        let target: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
        for (i, part) in target.chunks_mut(longest as usize).enumerate() {
            let mut commands = Recorder::new(self.context())?;
            commands.copy_region(self, begin + i as u64 * longest, &staging, 0, part.len() as u64);
            commands.submit_and_wait()?;
            staging.read_into(part)?;
        }
        Ok(values)
    }
}
