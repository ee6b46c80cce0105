//! Decoding photos in the background: in order, in parallel, in bounded memory.
//!
//! Pixels are taken as they are stored, as COLMAP's models and trainers take them, but for photos that fit their cameras only when they
//! are turned as their EXIF data say ([`super::orientation`]). Colours are straight (an alpha channel does not darken them) and taken for
//! sRGB; embedded colour profiles are ignored.

mod budget;
mod pixels;
#[cfg(test)]
mod tests;

use std::panic::AssertUnwindSafe;
use std::path::Path;
use std::sync::Arc;
use std::thread::JoinHandle;

use half::f16;

use self::budget::Queue;
use super::Photo;
use crate::engine::parallel::threads;
use crate::error::{Error, Result};
use crate::scene::camera::Intrinsics;
use crate::scene::colour;

/// What is made of the colours of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channels {
    /// Linear red, green and blue.
    Rgb,
    /// Luminance: 0.2126 R + 0.7152 G + 0.0722 B of linear values (ITU-R BT.709).
    Luma,
}

/// How values are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 8 bits, encoded as sRGB, rounded to the nearest. Of an 8-bit image that is not shrunk these are its own values.
    Byte,
    /// 16-bit floats, rounded to the nearest.
    Half,
    /// 32-bit floats.
    Single,
}

/// How to decode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DecodeSettings {
    /// Channels of the values.
    pub channels: Channels,
    /// Precision of the values.
    pub precision: Precision,
    /// Each pixel is the mean of `shrink` x `shrink` stored pixels, of linear values; the lens is then
    /// [`Intrinsics::shrunk`]. At least 1.
    pub shrink: u32,
    /// Bytes that photos take together from the start of their decoding until they are handed out: file, decoded pixels,
    /// scratch and result. A photo that takes more on its own is decoded alone.
    pub memory: u64,
    /// Threads; 0 for as many as there are: one per core, or a worker's share of them.
    pub threads: usize,
}

impl Default for DecodeSettings {
    fn default() -> Self {
        Self { channels: Channels::Rgb, precision: Precision::Single, shrink: 1, memory: 1 << 30, threads: 0 }
    }
}

impl DecodeSettings {
    /// Bytes of a decoded photo of `width` x `height` pixels with its mask.
    fn result_bytes(&self, width: u32, height: u32) -> u64 {
        let channels = if self.channels == Channels::Rgb { 3 } else { 1 };
        let bytes = match self.precision {
            Precision::Byte => 1,
            Precision::Half => 2,
            Precision::Single => 4,
        };
        u64::from(width / self.shrink).max(1) * u64::from(height / self.shrink).max(1) * (channels * bytes + 1)
    }
}

/// Values row by row from the top left, of three channels side by side: linear ones in [0, 1], or bytes of sRGB.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// 8-bit sRGB.
    Byte(Vec<u8>),
    /// 16-bit floats.
    Half(Vec<f16>),
    /// 32-bit floats.
    Single(Vec<f32>),
}

impl Values {
    /// The linear value at a place.
    pub fn linear(&self, index: usize) -> f32 {
        match self {
            Self::Byte(values) => colour::linear(values[index]) as f32,
            Self::Half(values) => values[index].to_f32(),
            Self::Single(values) => values[index],
        }
    }

    /// All linear values.
    pub fn into_linear(self) -> Vec<f32> {
        match self {
            Self::Byte(values) => values.into_iter().map(|value| colour::linear(value) as f32).collect(),
            Self::Half(values) => values.into_iter().map(f16::to_f32).collect(),
            Self::Single(values) => values,
        }
    }

    /// All values as bytes of sRGB.
    pub fn into_bytes(self) -> Vec<u8> {
        match self {
            Self::Byte(values) => values,
            Self::Half(values) => values.into_iter().map(|value| pixels::byte(value.to_f32())).collect(),
            Self::Single(values) => values.into_iter().map(pixels::byte).collect(),
        }
    }
}

/// A photo that has been decoded.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// Its place among the photos that were given.
    pub index: usize,
    /// Width in pixels, after shrinking.
    pub width: u32,
    /// Height in pixels, after shrinking.
    pub height: u32,
    /// The values.
    pub values: Values,
    /// How much of each pixel belongs to the object, 255 for all of it: from the mask file, or else from the image's alpha
    /// channel. None where there is neither. Values are means over the part that belongs to the object where there is any.
    pub mask: Option<Vec<u8>>,
}

/// An image of 8-bit sRGB-encoded colours.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Encoded {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Red, green and blue side by side, row by row from the top left.
    pub pixels: Vec<u8>,
}

/// Decodes a PNG or JPEG file to 8-bit colours as they are stored. Where it has an alpha channel, colours are straight and laid
/// over `background`: encoded values are mixed, as programs do that composite what they read.
///
/// # Errors
/// When the file cannot be opened, or is damaged, cut short or of another format.
pub fn encoded(path: &Path, background: [u8; 3]) -> Result<Encoded> {
    guarded(path, || pixels::encoded(path, background))
}

/// What a decoder makes of the file at `path`; should it panic, an error.
fn guarded<T>(path: &Path, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    // What panics leaves nothing behind that others see: files are only read.
    std::panic::catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err(Error::input(path, "the decoder failed on this image; save it again")))
}

/// Photos on their way, or what is made of them: an iterator in the order in which they were given, whose values depend on
/// nothing but the files and the settings. Dropped, it ends its threads after the photos that they are at.
///
/// # Errors
/// Each photo may fail on its own, in a line that names its file: no image, an image or a mask that is damaged, cut short or
/// of another size than the camera.
pub struct Decoder<T = Decoded> {
    queue: Arc<Queue<T>>,
    workers: Vec<JoinHandle<()>>,
}

impl Decoder {
    /// Starts to decode `photos`.
    ///
    /// # Errors
    /// Where the system gives no threads.
    pub fn new(photos: &[Photo], settings: DecodeSettings) -> Result<Self> {
        Self::making(photos, settings, 1, |_, decoded| Ok(decoded))
    }
}

impl<T: Send + 'static> Decoder<T> {
    /// Starts to decode `photos` and to apply `make` to each, on the same threads. What is made takes no more bytes
    /// than the decoded photo, and making it no more than `copies` times as many, the photo itself included.
    ///
    /// # Errors
    /// Where the system gives no threads.
    pub fn making(
        photos: &[Photo],
        settings: DecodeSettings,
        copies: u64,
        make: impl Fn(&Photo, Decoded) -> Result<T> + Send + Sync + 'static,
    ) -> Result<Self> {
        let settings = DecodeSettings { shrink: settings.shrink.max(1), ..settings };
        let threads = if settings.threads == 0 { threads() } else { settings.threads }.min(photos.len());
        let work = Arc::new(Work { photos: photos.into(), settings, copies, make });
        let mut decoder = Self { queue: Arc::new(Queue::new(photos.len(), settings.memory)), workers: Vec::new() };
        for _ in 0..threads {
            let (work, queue) = (Arc::clone(&work), Arc::clone(&decoder.queue));
            let worker = std::thread::Builder::new()
                .name("decode".into())
                .spawn(move || work.run(&queue))
                .map_err(|e| Error::request(format!("the system gives no thread to decode photos in ({e})")))?;
            decoder.workers.push(worker);
        }
        Ok(decoder)
    }
}

impl<T> Decoder<T> {
    /// Most bytes that were in flight at once so far, by the estimates that the budget is kept by.
    pub fn most_in_flight(&self) -> u64 {
        self.queue.most()
    }
}

impl<T> Iterator for Decoder<T> {
    type Item = Result<T>;

    fn next(&mut self) -> Option<Self::Item> {
        self.queue.next()
    }

    fn size_hint(&self) -> (usize, Option<usize>) {
        let left = self.queue.left();
        (left, Some(left))
    }
}

impl<T> ExactSizeIterator for Decoder<T> {}

impl<T> Drop for Decoder<T> {
    fn drop(&mut self) {
        self.queue.stop();
        for worker in self.workers.drain(..) {
            // A worker cannot panic: what decoders do is caught in `Work::run`.
            let _ = worker.join();
        }
    }
}

/// What the threads share.
struct Work<M> {
    photos: Arc<[Photo]>,
    settings: DecodeSettings,
    /// See [`Decoder::making`].
    copies: u64,
    make: M,
}

impl<M> Work<M> {
    /// Decodes photos until there are none left.
    fn run<T>(&self, queue: &Queue<T>)
    where
        M: Fn(&Photo, Decoded) -> Result<T>,
    {
        while let Some(index) = queue.take() {
            let photo = &self.photos[index];
            let Intrinsics { width, height, .. } = photo.camera.intrinsics;
            let result = self.settings.result_bytes(width, height);
            // A header that cannot be read costs nothing; decoding it reports why.
            let bytes = pixels::estimate(photo).map_or(0, |bytes| bytes + self.copies * result);
            if !queue.reserve(index, bytes) {
                return;
            }
            let path = photo.image.as_deref().unwrap_or(Path::new(&photo.camera.name));
            let made = guarded(path, || {
                pixels::decode(photo, index, &self.settings).and_then(|decoded| (self.make)(photo, decoded))
            });
            let left = if made.is_ok() { result } else { 0 };
            queue.finish(index, bytes, left.min(bytes), made);
        }
    }
}
