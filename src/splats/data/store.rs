//! Photos where the device can copy them from: in its own memory while they fit, in the host's after that.

use std::sync::Arc;

use crate::Result;
use crate::engine::vulkan::{Buffer, Context, Recorder};

/// Bytes of a buffer that photos are gathered in, unless one photo is larger.
const CHUNK: usize = 64 << 20;

/// Photos as words of 8-bit red, green, blue and alpha, packed into few buffers.
pub struct PhotoStore {
    context: Arc<Context>,
    chunks: Vec<Buffer>,
    /// Chunk, first byte and bytes of each photo.
    places: Vec<(usize, u64, u64)>,
    gathered: Vec<u32>,
    sum: crc32fast::Hasher,
    /// Bytes that may still go to the device's own memory.
    left: u64,
}

impl PhotoStore {
    /// An empty store that uses at most `most` bytes of the device's own memory.
    pub fn new(context: &Arc<Context>, most: u64) -> Self {
        Self {
            context: context.clone(),
            chunks: Vec::new(),
            places: Vec::new(),
            gathered: Vec::new(),
            sum: crc32fast::Hasher::new(),
            left: most,
        }
    }

    /// Adds a photo.
    ///
    /// # Errors
    /// Where the device fails or there is no memory for it.
    pub fn add(&mut self, pixels: &[u32]) -> Result<()> {
        if 4 * (self.gathered.len() + pixels.len()) > CHUNK {
            self.flush()?;
        }
        self.sum.update(bytemuck::cast_slice(pixels));
        self.places.push((self.chunks.len(), 4 * self.gathered.len() as u64, 4 * pixels.len() as u64));
        self.gathered.extend_from_slice(pixels);
        Ok(())
    }

    /// Brings the last photos to where they are copied from.
    ///
    /// # Errors
    /// As for [`PhotoStore::add`].
    pub fn flush(&mut self) -> Result<()> {
        let bytes = 4 * self.gathered.len() as u64;
        if bytes == 0 {
            return Ok(());
        }
        let chunk = if bytes <= self.left {
            self.left -= bytes;
            Buffer::from_slice(&self.context, "photos", &self.gathered)?
        } else {
            let chunk = Buffer::host(&self.context, "photos on the host", bytes)?;
            chunk.write(&self.gathered)?;
            chunk
        };
        self.chunks.push(chunk);
        self.gathered.clear();
        Ok(())
    }

    /// CRC-32 of all pixels.
    pub fn fingerprint(&self) -> u32 {
        self.sum.clone().finalize()
    }

    /// How many photos there are.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Records the copy of a photo; [`PhotoStore::flush`] must have been called after the last was added.
    pub fn record_copy(&self, commands: &mut Recorder, photo: usize, to: &Buffer) {
        let (chunk, from, bytes) = self.places[photo];
        commands.copy_region(&self.chunks[chunk], from, to, 0, bytes);
    }
}
