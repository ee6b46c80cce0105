//! Pictures of trained splats from a set of cameras, written to a folder.

use std::collections::HashMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, Mutex};
use std::thread;

use super::frame::Frame;
use super::rasterizer::{MAX_SIDE, Size};
use super::renderer::{Renderer, Rendering};
use super::wanted::Wanted;
use crate::engine::parallel::threads;
use crate::engine::vulkan::Context;
use crate::files::io::folder::OutputFolder;
pub use crate::files::io::picture::Format;
use crate::files::io::picture::{self, stem};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::gaussians::Gaussians;
use crate::{Error, Result};

/// What pictures are made, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Format of the files.
    pub format: Format,
    /// Write alpha and leave the background out.
    pub alpha: bool,
    /// Write depths beside each picture.
    pub depth: bool,
    /// sRGB colour behind everything.
    pub background: [f32; 3],
    /// Opacities reduced by what the low-pass widens, for models that were trained so.
    pub antialiased: bool,
    /// Depth before which nothing is drawn, in the model's units; without it [`super::frame::NEAR`] of the frame's.
    pub near: Option<f64>,
}

/// Most bytes that pictures on their way to the disk take, and what one takes for each pixel.
const MAX_BYTES: u64 = 1 << 30;
const BYTES_PER_PIXEL: u64 = 64;

/// The same cameras for pictures of another size.
///
/// # Errors
/// Where a camera's picture is of another shape.
pub fn resize(cameras: &mut [Camera], width: u32, height: u32) -> Result<()> {
    for camera in cameras {
        let own = camera.intrinsics;
        camera.intrinsics = own.resized(width, height).ok_or_else(|| {
            let fitting = (f64::from(own.height) * f64::from(width) / f64::from(own.width)).round().max(1.0);
            Error::request(format!(
                "{width} x {height} pixels have another shape than the {} x {} of camera {:?}; take {width}x{fitting}",
                own.width, own.height, camera.name
            ))
        })?;
    }
    Ok(())
}

/// The result of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Pictures that were rendered and written.
    pub pictures: u32,
    /// Those among them that show nothing but the background.
    pub empty: u32,
}

/// Cameras whose pictures have files and a size.
pub struct Job<'a> {
    cameras: &'a [Camera],
    settings: RenderSettings,
    /// Files of every camera, within the folder: picture and depths.
    names: Vec<[String; 2]>,
    /// Wide and high enough for every picture.
    largest: Size,
}

impl<'a> Job<'a> {
    /// Checks all that can be checked before a device is opened.
    ///
    /// # Errors
    /// Where two pictures would have the same file, a name is none, a picture is too large, or `near` is no depth.
    pub fn new(cameras: &'a [Camera], settings: RenderSettings) -> Result<Self> {
        if let Some(near) = settings.near.filter(|near| !(near.is_finite() && *near > 0.0)) {
            return Err(Error::request(format!("`near` is {near}; give a depth above 0")));
        }
        let mut largest = Size { width: 0, height: 0 };
        for camera in cameras {
            let Intrinsics { width, height, .. } = camera.intrinsics;
            if width.max(height) > MAX_SIDE {
                return Err(Error::request(format!(
                    "the picture of camera {:?} has {width} x {height} pixels, and a side has {MAX_SIDE} at most; give \
                     smaller ones with `size`",
                    camera.name
                )));
            }
            largest = Size { width: largest.width.max(width), height: largest.height.max(height) };
        }
        Ok(Self { cameras, settings, names: names(cameras, settings)?, largest })
    }

    /// Renders the Gaussians, which are in the cameras' world, and writes every picture as soon as it is there; `observe`
    /// receives their number and returns whether to continue.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory, or the system refuses a file.
    pub fn run(
        &self,
        context: &Arc<Context>,
        gaussians: Gaussians,
        folder: &OutputFolder,
        observe: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Outcome> {
        let (frame, mut renderer) = self.renderer(context, gaussians)?;
        thread::scope(|scope| {
            let (sender, receiver) = mpsc::sync_channel::<Task>(0);
            let receiver = Arc::new(Mutex::new(receiver));
            let write = |receiver: Arc<Mutex<Receiver<Task>>>| -> Result<()> {
                // A poisoned lock means that another writer panicked, which is propagated below.
                let next = || receiver.lock().ok().and_then(|tasks| tasks.recv().ok());
                while let Some(task) = next() {
                    self.write(&task, frame.extent())?;
                }
                Ok(())
            };
            let writer = |_| {
                let receiver = receiver.clone();
                scope.spawn(move || write(receiver))
            };
            let writers: Vec<_> = (0..self.writers()).map(writer).collect();
            // Once every writer has ended, sending fails.
            drop(receiver);
            let rendered = self.render(&mut renderer, &frame, folder, sender, observe);
            for writer in writers {
                writer.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
            }
            rendered
        })
    }

    /// Renders the Gaussians, which are in the cameras' world, without a folder: `take` receives every picture, with how many units of the
    /// world a unit of its depths is, and returns whether to continue.
    ///
    /// # Errors
    /// Where the device fails or has not enough memory.
    pub fn pictures(
        &self,
        context: &Arc<Context>,
        gaussians: Gaussians,
        mut take: impl FnMut(Rendering, f64) -> ControlFlow<()>,
    ) -> Result<()> {
        let (frame, mut renderer) = self.renderer(context, gaussians)?;
        for camera in self.cameras {
            if take(self.picture(&mut renderer, &frame, camera)?, frame.extent()).is_break() {
                break;
            }
        }
        Ok(())
    }

    fn renderer(&self, context: &Arc<Context>, gaussians: Gaussians) -> Result<(Frame, Renderer)> {
        let RenderSettings { depth, antialiased, .. } = self.settings;
        let frame = Frame::new(self.cameras, &gaussians.centres);
        let wanted = Wanted { antialiased, depths: depth, ..Wanted::default() };
        let renderer = Renderer::new(context, &frame.gaussians_to_training(gaussians), self.largest, wanted)?;
        Ok((frame, renderer))
    }

    /// The picture of a camera, over black where its alpha is wanted.
    fn picture(&self, renderer: &mut Renderer, frame: &Frame, camera: &Camera) -> Result<Rendering> {
        let mut view = frame.view(camera);
        if let Some(near) = self.settings.near {
            view.near = (frame.to_training.length(near) as f32).max(f32::MIN_POSITIVE);
        }
        renderer.picture(&view, if self.settings.alpha { [0.0; 3] } else { self.settings.background })
    }

    /// Renders picture after picture and hands them to the writers.
    fn render(
        &self,
        renderer: &mut Renderer,
        frame: &Frame,
        folder: &OutputFolder,
        tasks: SyncSender<Task>,
        mut observe: impl FnMut(u32) -> ControlFlow<()>,
    ) -> Result<Outcome> {
        let mut outcome = Outcome::default();
        for (camera, [picture, depths]) in self.cameras.iter().zip(&self.names) {
            let files = [folder.stage(picture)?, folder.stage(depths)?];
            let rendering = self.picture(renderer, frame, camera)?;
            let empty = rendering.pixels.iter().all(|pixel| pixel[3] == 1.0);
            if tasks.send(Task { rendering, files }).is_err() {
                // All writers have failed, and return their errors.
                break;
            }
            outcome.pictures += 1;
            outcome.empty += u32::from(empty);
            if observe(outcome.pictures).is_break() {
                break;
            }
        }
        Ok(outcome)
    }

    /// Writes a picture, and its depths in units of which the frame's has `unit`.
    fn write(&self, task: &Task, unit: f64) -> Result<()> {
        let RenderSettings { format, alpha, depth, .. } = self.settings;
        let Task { rendering, files: [picture, depths] } = task;
        let bytes = match alpha {
            true => picture::colours(format, rendering.width, &rendering.straight(), true)?,
            false => picture::colours(format, rendering.width, &rendering.pixels, false)?,
        };
        fs::write(picture, bytes).map_err(|source| Error::io(picture, source))?;
        if depth {
            let bytes = picture::depths(rendering.width, rendering.expected_depths(unit))?;
            fs::write(depths, bytes).map_err(|source| Error::io(depths, source))?;
        }
        Ok(())
    }

    /// Threads that encode and write: each has a picture, and one more is being rendered.
    fn writers(&self) -> usize {
        let pixels = u64::from(self.largest.width) * u64::from(self.largest.height);
        let most = MAX_BYTES / (BYTES_PER_PIXEL * pixels.max(1));
        threads().min(most as usize).max(1)
    }
}

/// A picture on its way to the disk, and the files of the picture and its depths.
struct Task {
    rendering: Rendering,
    files: [PathBuf; 2],
}

/// Files of each camera's picture and depths, by its name.
fn names(cameras: &[Camera], settings: RenderSettings) -> Result<Vec<[String; 2]>> {
    let mut owners = HashMap::new();
    let mut names = Vec::with_capacity(cameras.len());
    for camera in cameras {
        let Some(stem) = stem(&camera.name) else {
            return Err(Error::request(format!(
                "a camera is called {:?}, which names no file; rename it",
                camera.name
            )));
        };
        let both = [format!("{stem}.{}", settings.format.extension()), format!("{stem}.depth.exr")];
        for name in &both[..1 + usize::from(settings.depth)] {
            if let Some(other) = owners.insert(PathBuf::from(name), &camera.name) {
                let what = format!(
                    "the pictures of the cameras {other:?} and {:?} would both be {name}; rename one",
                    camera.name
                );
                return Err(Error::request(what));
            }
        }
        names.push(both);
    }
    for (name, owner) in &owners {
        if let Some(folder) = name.ancestors().skip(1).find(|folder| owners.contains_key(*folder)) {
            let folder = folder.display();
            let what = format!("the picture of camera {owner:?} would lie in {folder}, which is another's; rename one");
            return Err(Error::request(what));
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::camera::Pose;

    const SETTINGS: RenderSettings = RenderSettings {
        format: Format::Png,
        alpha: false,
        depth: false,
        background: [0.0; 3],
        antialiased: false,
        near: None,
    };

    fn cameras(names: &[&str]) -> Vec<Camera> {
        let pose = Pose::looking(DVec3::ZERO, DVec3::X, DVec3::Z);
        let intrinsics = Intrinsics::from_fov(64, 48, 1.0);
        names.iter().map(|name| Camera { name: (*name).into(), pose, intrinsics }).collect()
    }

    fn refusal(names: &[&str], settings: RenderSettings) -> String {
        Job::new(&cameras(names), settings).err().unwrap().to_string()
    }

    /// If this failed, a picture could not be matched to its photo's name, or be written anywhere on the disk.
    #[test]
    fn pictures_are_named_as_their_cameras_and_stay_inside() {
        let cases = [
            ("0001.jpg", "0001"),
            ("left/0001.JPG", "left/0001"),
            ("./a//b.tar.png", "a/b.tar"),
            ("r_0.5", "r_0.5"),
            ("plain", "plain"),
            ("../../a.png", "a"),
            ("/etc/../a.b/c", "etc/a.b/c"),
            (".hidden", ".hidden"),
        ];
        for (name, expected) in cases {
            assert_eq!(stem(name).as_deref(), Some(expected), "{name}");
        }
        for name in ["", "..", "/", "./"] {
            assert_eq!(stem(name), None, "{name}");
            assert!(refusal(&[name], SETTINGS).contains("names no file"));
        }
    }

    /// If this failed, one picture would silently take the place of another.
    #[test]
    fn pictures_of_one_name_are_refused() {
        assert!(Job::new(&cameras(&["a.jpg", "b/a.jpg", "a.depth.jpg"]), SETTINGS).is_ok());
        assert!(refusal(&["a.jpg", "b.jpg", "a.png"], SETTINGS).contains(r#""a.jpg" and "a.png" would both be a.png"#));
        assert!(refusal(&["a.jpg", "../a.jpg"], SETTINGS).contains("would both be a.png"));
        let exr = RenderSettings { format: Format::Exr, depth: true, ..SETTINGS };
        assert!(refusal(&["a.jpg", "a.depth.jpg"], exr).contains("would both be a.depth.exr"));
        assert!(refusal(&["a.jpg", "a.png/b.jpg"], SETTINGS).contains("would lie in a.png, which is another's"));
    }

    /// If this failed, sizes would overflow on the way to the device, or nothing at all be drawn.
    #[test]
    fn sizes_and_depths_that_cannot_be_are_refused() {
        let mut large = cameras(&["a", "b"]);
        large[1].intrinsics.height = 65_536;
        assert!(Job::new(&large, SETTINGS).err().unwrap().to_string().contains("64 x 65536 pixels"));
        for near in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(refusal(&["a"], RenderSettings { near: Some(near), ..SETTINGS }).contains("give a depth above 0"));
        }
    }

    /// If this failed, --size would squeeze pictures, or reject a size that fits.
    #[test]
    fn cameras_are_resized_in_their_shape() {
        let mut resized = cameras(&["a", "b"]);
        resize(&mut resized, 32, 24).unwrap();
        assert_eq!(resized[1].intrinsics, Intrinsics::from_fov(32, 24, 1.0));
        let refused = resize(&mut resized, 100, 100).unwrap_err().to_string();
        assert!(
            refused.contains("100 x 100 pixels have another shape") && refused.ends_with("take 100x75"),
            "{refused}"
        );
    }
}
