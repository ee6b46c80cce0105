//! `camsplat train`.

use std::cell::RefCell;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use clap::Args;

use super::convert::size;
use super::exif_exposure;
use super::options::{DeviceOptions, ImageOptions, print_messages};
use super::overwrite_guard::{check_output_file, check_output_folder};
use super::progress::{Progress, stop_on_interrupt};
use super::session::{Ended, go_on};
use crate::app::report::training::{self, Comparison, Model, Shown};
use crate::engine::vulkan::Context;
use crate::engine::vulkan::profile::Profile;
use crate::files::io;
use crate::files::io::folder::{check_file, check_folder, replace_file, write_files};
use crate::files::io::splats::{self, SplatFormat};
use crate::scene::camera::Camera;
use crate::splats::config::{Background, Masks, Preset, Start, Strategy, TrainConfig};
use crate::splats::data::pictures::cameras;
use crate::splats::data::split::{Split, Test};
use crate::splats::run::evaluate::Pair;
use crate::splats::run::outputs::{CHECKPOINT, MODEL, RECORD, REFINED, REPORT, model_in};
use crate::splats::run::record::{Evaluation, PhotosRecord, Quality, Status, TrainRecord};
use crate::splats::run::request::{Run, TrainEvent, TrainRequest};
use crate::splats::train::poses::Poses;
use crate::{Error, Result};

/// Arguments of `camsplat train`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Capture: posed photos, as COLMAP, transforms.json or NSVF have them
    capture: PathBuf,
    /// Folder for the trained file, test pictures, metrics, checkpoint and report
    #[arg(long)]
    out: PathBuf,
    /// How many iterations a run has
    #[arg(long, value_enum, default_value_t = Preset::Full)]
    preset: Preset,
    /// Iterations; the schedule is that of 30000, compressed for fewer [default: the preset's]
    #[arg(long)]
    iterations: Option<u32>,
    /// Maximum number of splats [default: 1000000, or as many as the device can address]
    #[arg(long)]
    max_splats: Option<u32>,
    /// How the number of splats changes
    #[arg(long, value_enum, default_value_t = Strategy::Mcmc)]
    strategy: Strategy,
    /// Degree of the spherical harmonics, 0 to 3
    #[arg(long = "sh", default_value_t = 3)]
    degree: u32,
    /// Background, also trained where masks or alpha leave the photo out [default: white where
    /// photos have masks or alpha that mean it, else black]
    #[arg(long, value_enum)]
    background: Option<Background>,
    /// Mip-Splatting's 2D filter: splats smaller than a pixel fade instead of growing; the file says so to renderers
    #[arg(long)]
    antialiased: bool,
    /// Learn each photo's exposure and white balance: for phones, whose photos of one thing differ. Test views are compared with the
    /// exposure that fits the other half of the picture
    #[arg(long)]
    exposure: bool,
    /// Correct each photo's pose, by a degree or so: where a phone's tracking or a reconstruction is off. In the end the poses of test
    /// views are corrected as well
    #[arg(long)]
    refine_poses: bool,
    /// What masks and alpha channels say of what they leave out
    #[arg(long, value_enum, default_value = "background")]
    masks: Masks,
    /// Penalise opacity and size more, above all at first: fewer floaters where a capture has no points and its photos
    /// show surroundings; other captures lose detail (mcmc only)
    #[arg(long)]
    suppress_floaters: bool,
    /// Sum gradients by atomic additions in any order: faster, but no two runs are the same
    #[arg(long)]
    fast: bool,
    /// Opacity of splats at the start [default: 0.5; adc, and below 10000 iterations
    /// (1000 without points that a photo saw), 0.1, or 0.95 at points with normals]
    #[arg(long)]
    init_opacity: Option<f64>,
    /// Size of splats at the start, in distances to their neighbours [default: 0.1; adc, and below 10000 iterations
    /// (1000 without points that a photo saw), 1, or 0.9 at points with normals]
    #[arg(long)]
    init_scale: Option<f64>,
    /// Hold out every Nth photo, in order of name, for testing; 0 for none [default: transforms_test.json where there is one, else 8]
    #[arg(long, conflicts_with = "test")]
    test_every: Option<u32>,
    /// Test with the photos of another capture in the same frame
    #[arg(long)]
    test: Option<PathBuf>,
    /// Downsampling factor of the photos: each pixel is the mean of a square of this many per side
    #[arg(long, default_value_t = 1)]
    shrink: u32,
    #[command(flatten)]
    images: ImageOptions,
    /// Seed of every random draw
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Iterations between checkpoints; 0 for one at the end
    #[arg(long, default_value_t = 5000)]
    save_every: u32,
    /// Iterations between evaluations of the test views; 0 for one at the end [default: a tenth of the iterations]
    #[arg(long)]
    evaluate_every: Option<u32>,
    /// Continue from the checkpoint in the folder
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Replace files in a folder that is not empty
    #[arg(long)]
    force: bool,
    /// Write the model in these formats too, beside point_cloud.ply
    #[arg(long, value_enum, value_delimiter = ',', value_name = "FORMATS")]
    format: Vec<SplatFormat>,
    /// Print how much device memory the training takes, and stop
    #[arg(long)]
    dry_run: bool,
    /// Print GPU time per stage
    #[arg(long)]
    profile: bool,
    /// Write a trace of host and GPU time that Perfetto opens
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Splats where nothing is said, on a device that can address so many.
const USUAL: u32 = 1_000_000;

/// Trains and writes the folder.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    if !(1..=64).contains(&arguments.shrink) {
        return Err(Error::request(format!("--shrink is {}; give 1 to 64", arguments.shrink)));
    }
    configuration(arguments, Start::Points).validate()?;
    if let Some(file) = &arguments.trace {
        check_file(file)?;
        check_output_file(file, [&arguments.capture])?;
    }
    if !arguments.dry_run {
        check_out(arguments)?;
    }
    let capture = io::photos::read(&arguments.capture, &arguments.images.options())?;
    for note in &capture.notes {
        say!("{note}");
    }
    let test = match (arguments.test_every, &arguments.test) {
        (Some(every), _) => Test::Every(every),
        (None, Some(capture)) => Test::Capture(capture.clone()),
        (None, None) => Test::Default,
    };
    let split = Split::new(capture, &test, arguments.images.options())?;
    for note in &split.notes {
        say!("{note}");
    }
    let mut config = configuration(arguments, Start::of(&split.train));
    config.background = arguments.background.unwrap_or_else(|| match arguments.masks {
        Masks::Background => split.usual_background(),
        Masks::Ignore => Background::Black,
    });
    let context = arguments.device.open()?;
    say!("device   {}", context.physical().title());
    config.max_splats = arguments.max_splats.unwrap_or_else(|| usual_splats(&context, config.degree));
    let request = TrainRequest {
        capture: arguments.capture.display().to_string(),
        split,
        shrink: arguments.shrink,
        folder: arguments.out.clone(),
        save_every: arguments.save_every,
        evaluate_every: arguments.evaluate_every.unwrap_or((config.iterations / 10).max(1)),
        config,
    };
    let (photos, tests) = (request.split.train.photos.len(), request.split.test.len());
    let exposures = exif_exposure::note(&request.split.train.photos).filter(|_| !arguments.exposure);
    let all = request.config.iterations;
    let complete = arguments.resume && is_complete(&request);
    let cameras = [&request.split.train.photos, &request.split.test].map(|photos| cameras(photos, request.shrink));
    let run = Run::new(&context, request)?;
    if arguments.dry_run {
        say!("{}", run.footprint().table().trim_end());
        say!("room     {} tiles reached by splats; more is made where a view needs it", run.capacity());
        run.check()?;
        say!("fits     {:.0} MiB are free", context.memory_available() as f64 / f64::from(1 << 20));
        return Ok(Ended::Done);
    }
    say!("photos   {photos} to train on, {tests} to test with");
    if let (true, Some(steps)) = (arguments.refine_poses, all.checked_div(photos as u32)) {
        let degrees = Poses::reach(steps).to_degrees();
        say!(
            "poses    {steps} steps for each photo correct {degrees:.1} degrees or so, and {:.1}% of the cameras' extent",
            100.0 * degrees.to_radians()
        );
    }
    if let Some(note) = exposures {
        say!("note     {note}");
    }
    if complete {
        say!("complete {all} iterations were trained already; nothing is left to do");
        write_formats(arguments)?;
        return Ok(Ended::Done);
    }
    stop_on_interrupt()?;
    let mut profile = (arguments.profile || arguments.trace.is_some()).then(Profile::default);
    let view = Watch::new(&arguments.out, all, cameras);
    let record = run.run(arguments.resume, profile.as_mut(), &mut |event| view.observe(event));
    view.progress.finish();
    print_messages(&context);
    let record = match record {
        Err(Error::Interrupted) => {
            say!("stopped before training began; nothing is written");
            return Ok(Ended::Stopped);
        }
        record => record?,
    };
    if let (Some(file), Some(profile)) = (&arguments.trace, &profile) {
        write_files(&[(file, profile.trace().as_bytes())])?;
    }
    print(&record, &arguments.out);
    if let (true, Some(profile)) = (arguments.profile, &profile) {
        say!("\n{}", profile.table().trim_end());
    }
    if record.status == Status::Interrupted {
        say!("stopped after {} iterations; go on with --resume", record.iterations);
        return Ok(Ended::Stopped);
    }
    write_formats(arguments)?;
    Ok(Ended::Done)
}

/// Writes the trained model in the other formats that were asked for.
fn write_formats(arguments: &Arguments) -> Result<()> {
    if arguments.format.is_empty() {
        return Ok(());
    }
    let (gaussians, _) = io::read_gaussians_with_notes(&arguments.out.join(MODEL))?;
    for format in &arguments.format {
        let mut notes = Vec::new();
        let bytes = splats::write(&gaussians, *format, &mut notes)?;
        let file = arguments.out.join(model_in(*format));
        replace_file(&file, |file| file.write_all(&bytes))?;
        say!("model    {}: {}", file.display(), size(bytes.len() as u64));
        for note in notes {
            say!("         {note}");
        }
    }
    Ok(())
}

/// Whether the folder holds all that the run would leave: the record is written last. A run that differs in anything goes on
/// to be refused by the checkpoint, which knows more.
fn is_complete(request: &TrainRequest) -> bool {
    let text = fs::read_to_string(request.folder.join(RECORD)).unwrap_or_default();
    let is_of = |record: TrainRecord| {
        let PhotosRecord { capture, train, test, shrink, .. } = record.photos;
        let photos = (request.split.train.photos.len(), request.split.test.len());
        record.status == Status::Complete
            && record.config == request.config
            && (!record.config.refine_poses || request.folder.join(REFINED).is_file())
            && (capture, (train, test), shrink) == (request.capture.clone(), photos, request.shrink)
            && io::read_gaussians_with_notes(&request.folder.join(MODEL))
                .is_ok_and(|(model, _)| model.len() == record.splats as usize)
    };
    serde_json::from_str(&text).is_ok_and(is_of)
}

/// What was asked for.
fn configuration(arguments: &Arguments, start: Start) -> TrainConfig {
    let config = TrainConfig::new(
        arguments.iterations.unwrap_or(arguments.preset.iterations()),
        arguments.max_splats.unwrap_or(USUAL),
    )
    .with_strategy(arguments.strategy, start);
    TrainConfig {
        degree: arguments.degree,
        antialiased: arguments.antialiased,
        suppress_floaters: arguments.suppress_floaters,
        exposure: arguments.exposure,
        refine_poses: arguments.refine_poses,
        masks: arguments.masks,
        fast: arguments.fast,
        seed: arguments.seed,
        init_opacity: arguments.init_opacity.unwrap_or(config.init_opacity),
        init_scale: arguments.init_scale.unwrap_or(config.init_scale),
        ..config
    }
}

/// Refuses a folder that is not to be written to, before anything has been read.
fn check_out(arguments: &Arguments) -> Result<()> {
    let file = arguments.out.join(CHECKPOINT);
    if arguments.resume && !file.is_file() {
        return Err(Error::input(
            &file,
            "there is no checkpoint to resume from; train without --resume (with --force where the folder is not empty)",
        ));
    }
    // What is read may be what an earlier run left: its corrected cameras.
    check_output_folder(&arguments.out, [&arguments.capture].into_iter().chain(&arguments.test))?;
    check_folder(&arguments.out, arguments.force || arguments.resume)
}

/// As many splats as are usual, or as fit one buffer of the device.
fn usual_splats(context: &Context, degree: u32) -> u32 {
    let limit = context.physical().storage_range.min(context.physical().allocation);
    let most = limit / (4 * crate::splats::render::layout::planes(degree) as u64);
    USUAL.min(u32::try_from(most / 1000 * 1000).unwrap_or(u32::MAX))
}

/// What the user sees of a run, and the files that are kept fresh.
struct Watch {
    progress: Progress,
    iterations: u32,
    folder: PathBuf,
    /// The worst test views, by evaluations and their number: encoding them takes longer than hundreds of iterations.
    shown: RefCell<([usize; 2], Shown)>,
    /// Training and test cameras, which the model is shown from.
    cameras: [Vec<Camera>; 2],
    model: RefCell<Option<Model>>,
}

impl Watch {
    fn new(folder: &Path, iterations: u32, cameras: [Vec<Camera>; 2]) -> Self {
        Self {
            progress: Progress::over("decoding photos", iterations, "iterations"),
            iterations,
            folder: folder.to_owned(),
            shown: RefCell::new(([usize::MAX; 2], Shown::default())),
            cameras,
            model: RefCell::default(),
        }
    }

    fn observe(&self, event: TrainEvent) -> ControlFlow<()> {
        match event {
            TrainEvent::Photos(done, all) => self.progress.set(done as u32, all as u32),
            TrainEvent::Iterations(done) => self.progress.set(done, self.iterations),
            TrainEvent::Tests(done, all) => {
                self.progress.name("correcting test views");
                self.progress.set(done as u32, all as u32);
            }
            TrainEvent::Evaluated(evaluation) => self.progress.line(&line(evaluation)),
            TrainEvent::NotSaved(error) => self.progress.line(&format!("warning: no checkpoint was written: {error}")),
            TrainEvent::Note(note) => self.progress.line(&format!("note     {note}")),
            TrainEvent::Trained(gaussians) => {
                let [trained, tests] = &self.cameras;
                *self.model.borrow_mut() = Some(Model::new(gaussians, trained, tests));
            }
            TrainEvent::Report(record, worst) => {
                if self.shown.borrow().0[0] == usize::MAX {
                    self.progress.line(&start(record));
                }
                let psnr = record.curve.last().map_or(String::new(), |point| format!(", {:.2} dB", point.psnr));
                self.progress.name(&format!("training{psnr}"));
                if record.status == Status::Running && record.iterations > 0 {
                    let (done, all) = (record.iterations, record.config.iterations);
                    let left = self.progress.left();
                    self.progress.tell(|| {
                        format!("running  {done} of {all} iterations, {} splats{psnr}, {left} left", record.splats)
                    });
                }
                if let Err(error) = self.write(record, worst) {
                    self.progress.line(&format!("warning: no report was written: {error}"));
                }
            }
        }
        go_on()
    }

    /// Writes the record and the report.
    fn write<'w>(&self, record: &TrainRecord, worst: &'w [(String, Pair)]) -> Result<()> {
        let json = serde_json::to_string_pretty(record)
            .map_err(|e| Error::input(&self.folder, format!("train.json cannot be written: {e}")))?;
        let mut shown = self.shown.borrow_mut();
        let key = [record.evaluations.len(), worst.len()];
        if shown.0 != key {
            let comparison = |(name, pair): &'w (String, Pair)| Comparison {
                name,
                width: pair.width,
                height: pair.height,
                rendered: &pair.rendered,
                reference: &pair.reference,
            };
            let worst: Vec<Comparison> = worst.iter().map(comparison).collect();
            *shown = (key, Shown::new(record, &worst)?);
        }
        let page = training::html(record, &shown.1, self.model.borrow().as_ref())?;
        // Under hidden names that the next attempt takes as well: a run that is killed often leaves no pile of them.
        replace_file(&self.folder.join(REPORT), |file| file.write_all(page.as_bytes()))?;
        replace_file(&self.folder.join(RECORD), |file| file.write_all(json.as_bytes()))
    }
}

/// What a run begins with.
fn start(record: &TrainRecord) -> String {
    let (splats, points) = (record.splats, record.photos.points);
    match (record.iterations, points) {
        (0, 0) => {
            let TrainConfig { suppress_floaters, strategy, background, .. } = record.config;
            let helps = !suppress_floaters && strategy == Strategy::Mcmc && background == Background::Black;
            let hint = if helps { "; against floaters: --suppress-floaters" } else { "" };
            format!("start    {splats} splats at random: the capture has no points{hint}")
        }
        (0, _) if (splats as usize) < points => {
            format!("start    {splats} of the capture's {points} points (--max-splats)")
        }
        (0, _) => format!("start    {splats} splats at the capture's points"),
        (done, _) => format!("start    {splats} splats after {done} iterations, from the checkpoint"),
    }
}

fn line(evaluation: &Evaluation) -> String {
    let Evaluation { iteration, views, quality } = evaluation;
    format!("tested   {iteration} iterations, {views} views: {}", text(quality))
}

fn text(quality: &Quality) -> String {
    let lpips = quality.lpips.map_or(String::new(), |lpips| format!(", LPIPS {lpips:.4}"));
    format!("PSNR {:.2} dB, SSIM {:.4}{lpips}", quality.psnr, quality.ssim)
}

fn print(record: &TrainRecord, folder: &Path) {
    let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let worked = record.gpu_seconds.map_or(String::new(), |gpu| format!("; the device worked for {gpu:.1} s"));
    say!(
        "trained  {} iterations in {:.1} s ({:.1} a second{worked}), {} of {} splats",
        record.seconds_for,
        record.seconds,
        f64::from(record.seconds_for) / record.seconds.max(1e-9),
        record.splats,
        record.config.max_splats
    );
    say!("memory   {:.0} MiB at most, {:.0} announced", mib(record.memory.peak), mib(record.memory.announced));
    if let (Status::Complete, Some(last)) = (record.status, record.evaluations.last()) {
        say!("test     {} views: {}", last.views, text(&last.quality));
    }
    for line in [record.diverged_line(), record.overfitted_line(), record.short_line()].into_iter().flatten() {
        say!("warning  {line}");
    }
    if let Some(line) = record.poses_line() {
        say!("poses    {line}: {}", folder.join(REFINED).display());
    }
    say!("model    {}", folder.join(MODEL).display());
    say!("report   {}", folder.join(REPORT).display());
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: Arguments,
    }

    /// If this failed, `--preset fast` would train as long as without it, or be stronger than `--iterations`.
    #[test]
    fn a_preset_sets_the_iterations_unless_they_are_given() {
        let iterations = |options: &str| {
            let words = "train capture --out o".split(' ').chain(options.split_whitespace());
            configuration(&Line::parse_from(words).arguments, Start::Points).iterations
        };
        assert_eq!(["", "--preset fast"].map(iterations), [30_000, 7000]);
        assert_eq!(iterations("--preset fast --iterations 12"), 12);
    }
}
