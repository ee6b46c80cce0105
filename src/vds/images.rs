//! Photos from their files.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread;

use super::pyramid::Pyramid;
use crate::photos::Photo;
use crate::{Error, Result};

fn open(path: &Path) -> Result<image::DynamicImage> {
    image::open(path).map_err(|e| Error::input(path, format!("the image cannot be read: {e}; replace it")))
}

fn pyramid(photo: &Photo) -> Result<Option<Pyramid>> {
    let Some(path) = &photo.image else { return Ok(None) };
    let rgb = open(path)?.into_rgb8();
    let mask = photo.mask.as_ref().map(|path| open(path)).transpose()?.map(image::DynamicImage::into_luma8);
    let linear: [f32; 256] = std::array::from_fn(|v| crate::io::colour::linear(v as u8) as f32);
    let luma: Vec<f32> = rgb
        .as_raw()
        .chunks_exact(3)
        .map(|p| {
            let [r, g, b] = [0, 1, 2].map(|c| linear[usize::from(p[c])]);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        })
        .collect();
    Ok(Some(Pyramid::new(rgb.width(), rgb.height(), &luma, mask.as_ref().map(|mask| &mask.as_raw()[..]))))
}

/// Decodes the photos in the background and hands them to `take` as a source.
pub fn decoded<T>(
    photos: &[Photo],
    take: impl FnOnce(&mut dyn FnMut() -> Result<Option<(usize, Pyramid)>>) -> Result<T>,
) -> Result<T> {
    let workers = thread::available_parallelism().map_or(1, |n| n.get());
    let next = AtomicUsize::new(0);
    let (sender, receiver) = sync_channel(2);
    thread::scope(|scope| {
        for _ in 0..workers {
            let (sender, next) = (sender.clone(), &next);
            scope.spawn(move || {
                loop {
                    let k = next.fetch_add(1, Ordering::Relaxed);
                    let Some(photo) = photos.get(k) else { return };
                    if sender.send((k, pyramid(photo))).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        let receiver = receiver;
        take(&mut || {
            loop {
                match receiver.recv() {
                    Err(_) => return Ok(None),
                    Ok((_, Ok(None))) => {}
                    Ok((k, pyramid)) => return pyramid.map(|pyramid| pyramid.map(|pyramid| (k, pyramid))),
                }
            }
        })
    })
}
