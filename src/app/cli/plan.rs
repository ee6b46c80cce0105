//! `camsplat plan`.

use std::path::PathBuf;
use std::sync::Arc;

use clap::{ArgGroup, Args};

use super::baselines::{self, BaselineOptions};
use super::options::{CameraOptions, DeviceOptions, print_messages, read_cameras};
use super::order::Order;
use super::outcome::print_plan;
use super::overwrite_guard::{check_output_file, check_output_folder};
use super::photographed;
use super::progress::{Progress, leave_on_interrupt, stop_on_interrupt};
use super::region::RegionOptions;
use super::score::mostly_outside;
use super::session::{self, Ended, go_on};
use super::vds;
use super::viewers::ViewerOptions;
use crate::app::report;
use crate::engine::vulkan::Context;
use crate::engine::vulkan::capture::RenderDoc;
use crate::engine::vulkan::profile::Profile;
use crate::files::io;
use crate::files::io::folder::{OutputFolder, check_file, write_files};
use crate::files::photos::PhotoSet;
use crate::photogrammetry::vds::scoring::ScoringSettings;
use crate::planner::methods::Method;
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::gate::Gate;
use crate::planner::plan::paper::PaperConfig;
use crate::planner::plan::pipeline::{self, Tools};
use crate::planner::plan::preparation::Preparation;
use crate::planner::plan::problem::Problem;
use crate::planner::plan::{curve, footprint};
use crate::planner::quality::expected::decibels;
use crate::scene::surface::Surface;
use crate::{Error, Result};

/// Arguments of `camsplat plan`.
#[derive(Args, Debug)]
#[command(group(ArgGroup::new("budget").required(true).args(["views", "curve"])))]
pub struct Arguments {
    /// PLY points, mesh or trained splat; OBJ; glTF or GLB; COLMAP model folder; capture folder, whose photos define the up direction,
    /// lens, image size and region
    #[arg(value_name = "SURFACE")]
    scene: PathBuf,
    /// Surface to plan for instead of the capture's own points, in its frame, such as one that `camsplat proxy` made
    #[arg(long, value_name = "FILE")]
    surface: Option<PathBuf>,
    /// Cameras to place
    #[arg(long)]
    views: Option<u32>,
    /// Report how many views are worth taking: plan with 5 to 300 views and write the expected quality of each (curve.svg, curve.json)
    #[arg(long, conflicts_with_all = ["method", "dry_run", "profile", "trace", "renderdoc"])]
    curve: bool,
    /// Folder to write
    #[arg(long)]
    out: PathBuf,
    /// Write into a folder that is not empty; files of the same names are replaced, all others stay
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    region: RegionOptions,
    #[command(flatten)]
    camera: CameraOptions,
    #[command(flatten)]
    viewers: ViewerOptions,
    /// Existing cameras (COLMAP or NSVF folder, transforms.json, plan.json or .log): they count and are never moved
    #[arg(long)]
    keep: Option<PathBuf>,
    /// Place the cameras so that structure from motion can join their photos to each other and to those of --keep: neighbours share
    /// surface and see it at no wider an angle between them than this, in degrees, such as 20
    #[arg(long, value_name = "DEGREES", conflicts_with = "curve")]
    connect: Option<f32>,
    /// Order of the planned cameras: a short tour that keeps the clearance, or as they were placed [default: tour; none with
    /// --method paper-iterative and baselines, whose first cameras are a plan of fewer]
    #[arg(long, value_enum)]
    order: Option<Order>,
    #[command(flatten)]
    device: DeviceOptions,
    /// Print the device memory that the plan takes, and stop
    #[arg(long)]
    dry_run: bool,
    /// Print GPU time per stage
    #[arg(long)]
    profile: bool,
    /// Write a trace of host and GPU time that Perfetto opens
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Capture one iteration with RenderDoc into FILE_*.rdc
    #[arg(long, value_name = "FILE")]
    renderdoc: Option<PathBuf>,
    // The last, since their headings would stand above whatever follows.
    #[command(flatten)]
    baselines: BaselineOptions,
    #[command(flatten)]
    tuning: Tuning,
}

/// Declares options that are fields of [`Config`], and what sets those that are given.
macro_rules! of_config {
    ($($(#[$meta:meta])* $field:ident: $kind:ty,)*) => {
        /// Options of all objectives. What is left out is the default of the preset and the method.
        #[derive(Args, Debug, Default)]
        pub struct OfConfig {
            $($(#[$meta])* #[arg(long)] $field: Option<$kind>,)*
        }

        impl OfConfig {
            fn set(&self, config: &mut Config) {
                $(if let Some(given) = self.$field { config.$field = given; })*
            }
        }
    };
}

of_config! {
    /// Iterations [default: 100; in rooms 600; with --method paper 1000]
    iterations: u32,
    /// Viewers per iteration; with --method paper point cameras [default: 20]
    probes: u32,
    /// Field-of-view test while optimising [default: pinhole; with --method paper soft]
    #[arg(value_enum)]
    gate: Gate,
    /// Softness of the gate, in cosines (cone) or sines (pinhole) [default: 0.01; with --method paper 0.02]
    gate_softness: f32,
    /// Weight of the region term [default: 10]
    lambda_bound: f32,
    /// Learning rate of positions, in radii of the region [default: 0.015; with --method paper 0.0065]
    lr_position: f32,
    /// Learning rate of directions [default: 0.05; with --method paper 0.02]
    lr_direction: f32,
    /// Surface points for the geometric metrics, apart from those that are planned for [default: 1000]
    held_out: u32,
    /// Iterations between checkpoints of the metrics [default: 50]
    checkpoint_every: u32,
}

/// The optimisation.
#[derive(Args, Debug, Default)]
#[command(next_help_heading = "Optimisation")]
pub struct Tuning {
    /// Seed of every random number
    #[arg(long, default_value_t = 0)]
    seed: u64,
    #[command(flatten)]
    own: OfConfig,
    // The last, since its heading would stand above whatever follows.
    #[command(flatten, next_help_heading = "The paper's objective (--method paper, paper-no-vds and paper-iterative)")]
    paper: PaperConfig,
}

impl Tuning {
    /// The configuration of a method, or what baselines take of it.
    ///
    /// # Errors
    /// Where options of the paper's objective are given to another method.
    pub fn config(&self, preset: Preset, views: u32, method: Method) -> Result<Config> {
        let plain = if method.is_paper() { Config::paper(preset, views) } else { Config::new(preset, views) };
        if let (false, Some(option)) = (method.is_paper(), self.of_paper()) {
            return Err(Error::request(format!("--{option} goes with --method paper; leave it out, or give that")));
        }
        let mut config = plain.with_paper(|own| *own = self.paper.clone());
        config.seed = self.seed;
        self.own.set(&mut config);
        Ok(config)
    }

    /// The first option of the paper's objective that has another value than its default.
    fn of_paper(&self) -> Option<String> {
        let fields = |config: &PaperConfig| serde_json::to_value(config).ok()?.as_object().cloned();
        let (given, usual) = (fields(&self.paper)?, fields(&PaperConfig::default())?);
        let key = given.iter().find(|(key, value)| usual.get(*key) != Some(value))?.0;
        let options = PaperConfig::augment_args(clap::Command::new("paper"));
        let option = options.get_arguments().find(|option| option.get_id() == key.as_str())?;
        option.get_long().map(str::to_owned)
    }
}

/// Plans, writes the folder and prints what came out.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let views = arguments.views.unwrap_or(1);
    let method = arguments.baselines.method;
    let config = arguments.tuning.config(arguments.region.preset(), views, method)?;
    let config = Config { viewers: arguments.viewers.viewers()?, ..config };
    let config = method.planner(&config).unwrap_or(config);
    let config = match arguments.connect {
        Some(degrees) => {
            let connected = config.connected(degrees)?;
            Config { iterations: arguments.tuning.own.iterations.unwrap_or(connected.iterations), ..connected }
        }
        None => config,
    };
    config.validate()?;
    let baseline = arguments.baselines.request(&config)?;
    let in_turn = config.of_paper().is_some_and(|own| own.iterative) || baseline.is_some();
    let order = arguments.order.unwrap_or(if in_turn { Order::None } else { Order::Tour });
    if let (Some(baseline), true) = (
        &baseline,
        arguments.dry_run || arguments.profile || arguments.trace.is_some() || arguments.renderdoc.is_some(),
    ) {
        let name = baseline.request.method.name();
        return Err(Error::request(format!("--method {name} takes no --dry-run, --profile, --trace or --renderdoc")));
    }
    for file in [&arguments.trace, &arguments.renderdoc].into_iter().flatten() {
        check_file(file)?;
    }
    let model = arguments.baselines.model.model.as_ref();
    let inputs = || {
        [Some(&arguments.scene), arguments.surface.as_ref(), arguments.keep.as_ref(), model]
            .into_iter()
            .flatten()
            .chain(&arguments.region.limits.keep_out)
    };
    arguments.trace.iter().try_for_each(|file| check_output_file(file, inputs()))?;
    // Before any Vulkan instance is made.
    let renderdoc = arguments.renderdoc.as_ref().map(|_| RenderDoc::load()).transpose()?;
    arguments.camera.intrinsics(&[])?;
    let folder = if arguments.dry_run { None } else { Some(OutputFolder::create(&arguments.out, arguments.force)?) };
    if folder.is_some() {
        check_output_folder(&arguments.out, inputs())?;
    }
    arguments.region.choice()?;
    let mut opened = None;
    let reads_photos = baseline.is_none() && config.of_paper().is_some_and(|own| own.vds);
    let kept = match &arguments.keep {
        // What is left out of a capture is said where that is read.
        Some(path) if *path == arguments.scene => io::read_cameras(path)?,
        Some(path) => read_cameras(path)?,
        None => Vec::new(),
    };
    let (intrinsics, target, photos) = match captured(arguments, reads_photos, &mut opened)? {
        Some((surface, photos)) => {
            let path = arguments.surface.as_ref().unwrap_or(&arguments.scene);
            let intrinsics = arguments.camera.intrinsics(&photos.cameras())?;
            let target = arguments.region.target_of(&surface, path, Some(&photos), &intrinsics, None)?;
            (intrinsics, target, Some(photos))
        }
        None => {
            let intrinsics = arguments.camera.intrinsics(&kept)?;
            (intrinsics, arguments.region.target(&arguments.scene, &intrinsics, None)?, None)
        }
    };
    if let Some(count) = mostly_outside(&target, &kept).filter(|_| target.limits.is_empty()) {
        let all = kept.len();
        say!("warning  {count} of {all} kept cameras are outside of the region; are surface and cameras in one frame?");
    }
    if baseline.is_some() {
        leave_on_interrupt()?;
    }
    let context = opened.map_or_else(|| arguments.device.open_to_capture(arguments.renderdoc.is_some()), Ok)?;
    say!("device   {}", context.physical().title());
    let problem = Problem::new(&target, intrinsics, &kept)?;
    let Some(folder) = folder else {
        let preparation = Preparation::new(&context, &problem, config)?;
        say!("{}", preparation.footprint().table().trim_end());
        footprint::check(preparation.footprint(), &context)?;
        say!("fits     {:.0} MiB are free", context.memory_available() as f64 / f64::from(1 << 20));
        return Ok(Ended::Done);
    };
    if arguments.curve {
        return draw_curve(&context, &problem, &config, folder);
    }
    if let Some(baseline) = &baseline {
        return baselines::run(&context, baseline, &problem, photos.as_ref(), order, folder);
    }

    stop_on_interrupt()?;
    let mut profile = (arguments.profile || arguments.trace.is_some()).then(Profile::default);
    let progress = Progress::new(config.iterations);
    let capture = renderdoc.as_ref().zip(arguments.renderdoc.clone());
    let tools = Tools { profile: profile.as_mut(), capture, whole_only: session::current().drops_parts() };
    let plan = pipeline::run(&context, &problem, config, tools, |event| progress.observe(event));
    progress.finish();
    let mut plan = match plan {
        Err(Error::Interrupted) => {
            say!("stopped; nothing is written");
            return Ok(Ended::Stopped);
        }
        plan => plan?,
    };
    order.apply(&mut plan);
    print_messages(&context);
    let path = folder.path().to_owned();
    report::folder::write(&plan, &target, photos.as_ref(), folder)?;
    if let (Some(file), Some(profile)) = (&arguments.trace, &profile) {
        write_files(&[(file, profile.trace().as_bytes())])?;
    }
    print_plan(&plan);
    if let (true, Some(profile)) = (arguments.profile, &profile) {
        say!("\n{}", profile.table().trim_end());
    }
    say!("report   {}", path.join("report.html").display());
    if plan.interrupted() {
        say!("stopped after {} iterations; the plan so far is written", plan.record.history.len());
        return Ok(Ended::Stopped);
    }
    Ok(Ended::Done)
}

/// Plans with ever more views and writes what is expected of each.
fn draw_curve(context: &Arc<Context>, problem: &Problem<'_>, config: &Config, folder: OutputFolder) -> Result<Ended> {
    leave_on_interrupt()?;
    say!("expected quality, less that of the most views");
    say!("{:>5} {:>9} {:>8}", "views", "expected", "unseen");
    let kept = problem.kept.len();
    let progress = Progress::over("planning", curve::BUDGETS.len() as u32, "plans");
    let mut begun = 0;
    let points = curve::curve(context, problem, config, |_| {
        begun += 1;
        progress.set(begun - 1, curve::BUDGETS.len() as u32);
        go_on()
    });
    progress.finish();
    let points = points?;
    for point in &points {
        say!("{:>5} {:>9} {:>7.1}%", point.views, decibels(point.db, 2), 100.0 * point.unseen);
    }
    print_messages(context);
    say!("{}", curve::sentence(&points, kept));
    say!("{}", curve::caution(config.preset));
    let path = folder.path().join("curve.svg");
    folder.write("curve.svg", curve::svg(&points, kept, config.preset))?;
    let text = serde_json::to_string_pretty(&points);
    folder.write("curve.json", text.map_err(|e| Error::request(format!("the curve cannot be written: {e}")))?)?;
    folder.commit()?;
    say!("plot     {}", path.display());
    Ok(Ended::Done)
}

/// The surface of a capture, its points scored from its photos where it has any, and its cameras; none where the scene is no capture.
/// The device is opened only for photos.
fn captured(
    arguments: &Arguments,
    reads_photos: bool,
    opened: &mut Option<Arc<Context>>,
) -> Result<Option<(Surface, PhotoSet)>> {
    if !io::may_be_capture(&arguments.scene) {
        return match &arguments.surface {
            Some(_) => {
                Err(Error::input(&arguments.scene, "--surface goes with a capture, and this is none; leave one out"))
            }
            None => Ok(None),
        };
    }
    let (surface, capture) =
        photographed::read(&arguments.scene, arguments.surface.as_deref(), arguments.keep.is_some())?;
    if arguments.surface.is_some() {
        if reads_photos {
            say!("vds      the photos are left unread (--surface); `camsplat vds --surface` scores it");
        }
        return Ok(Some((surface, capture)));
    }
    let images = capture.photos.iter().filter(|photo| photo.image.is_some()).count();
    let method = arguments.baselines.method;
    let unread = match () {
        () if arguments.dry_run => Some("--dry-run".into()),
        () if method == Method::Ours => Some("expected quality takes no scores; --method paper does".into()),
        () if !reads_photos => Some(format!("--method {}", method.name())),
        () if images < 2 => Some("fewer than two have an image".into()),
        () => None,
    };
    if let Some(reason) = unread {
        say!("vds      the photos are left unread ({reason})");
        return Ok(Some((surface, capture)));
    }
    let context = opened.insert(arguments.device.open_to_capture(arguments.renderdoc.is_some())?);
    let settings = ScoringSettings { seed: arguments.tuning.seed, skip_unreadable: true, ..ScoringSettings::default() };
    let scored = vds::score(context, &capture, &surface, &settings)?.onto(&capture.points);
    Ok(Some((Surface::Points(scored), capture)))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[derive(clap::Parser)]
    struct Planning {
        #[command(flatten)]
        tuning: Tuning,
    }

    /// If this failed, the help would tell another default than the one that is used.
    #[test]
    fn the_help_tells_the_defaults() {
        let config = Tuning::default().config(Preset::Object, 50, Method::Ours).unwrap();
        let config = serde_json::to_value(config).unwrap();
        let mut told = 0;
        for argument in Planning::command().get_arguments() {
            let help = argument.get_help().map(ToString::to_string).unwrap_or_default();
            let Some((_, default)) = help.split_once("[default: ") else { continue };
            let default = default.split([';', ']']).next().unwrap_or_default();
            let Some(used) = config.get(argument.get_id().as_str()) else { continue };
            let same = match used.as_f64() {
                Some(used) => default.parse() == Ok(used as f32),
                None => used.as_str() == Some(default),
            };
            assert!(same, "{}: {default} in the help, {used} in the configuration", argument.get_id());
            told += 1;
        }
        assert_eq!(told, 9, "defaults of numbers and choices");
    }

    /// If this failed, the paper's options would be ignored in silence beside other methods, or not reach the plan.
    #[test]
    fn options_of_the_paper_go_with_its_method() {
        let of = |line: &str, method| {
            let parsed =
                <Planning as clap::Parser>::try_parse_from(["plan"].into_iter().chain(line.split_whitespace()));
            parsed.unwrap().tuning.config(Preset::Object, 5, method).map_err(|error| error.to_string())
        };
        for (line, option) in
            [("--kernel metric", "--kernel"), ("--no-occlusion", "--no-occlusion"), ("--scale 0.1", "--scale")]
        {
            let refused = of(line, Method::Ours).unwrap_err();
            assert!(refused.contains(option) && refused.contains("--method paper"), "{refused}");
        }
        let config = of("--equal-directions --relocate-every 0 --alpha 0.2", Method::Paper).unwrap();
        let own = config.of_paper().unwrap();
        assert_eq!((own.equal_probes, own.relocate_every, own.alpha, own.vds), (false, 0, 0.2, true));
        assert!(of("--probes 7 --lambda-bound 3", Method::Ours).is_ok_and(|c| (c.probes, c.lambda_bound) == (7, 3.0)));
    }
}
