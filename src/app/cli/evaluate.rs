//! `camsplat evaluate`.

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;

use super::evaluation_page::Page;
use super::options::{DeviceOptions, print_messages};
use super::progress::stop_on_interrupt;
use super::region::{LimitOptions, box_of};
use super::session::{self, Ended, go_on};
use super::viewers::ViewerOptions;
use crate::files::io;
use crate::files::io::environment::read_environment;
use crate::lab::evaluate::artifact::ArtifactEvent;
use crate::lab::evaluate::competitor::Competitor;
use crate::lab::evaluate::destination;
use crate::lab::evaluate::evaluation::{self, EvaluationEvent};
use crate::lab::evaluate::kind::Kind;
use crate::lab::evaluate::pool::Pool;
use crate::lab::evaluate::request::EvaluationRequest;
use crate::lab::evaluate::results::Entry;
use crate::lab::evaluate::scene::{Scene, Setting};
use crate::lab::evaluate::settings::{BaselinesFrom, EvaluationSettings, InputsFrom, Shown, Space};
use crate::lab::evaluate::shard::Shard;
use crate::lab::evaluate::situation::Situation;
use crate::lab::evaluate::subject::Subject;
use crate::lab::evaluate::table;
use crate::lab::evaluate::task;
use crate::lab::path_tracer::lightmap::Light;
use crate::planner::plan::config::Preset;
use crate::planner::plan::target::RegionChoice;
use crate::scene::limits::Limits;
use crate::splats::image_metrics::{Network, Weights};
use crate::{Error, Result};

/// Arguments of `camsplat evaluate`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Objects or rooms with materials and lights: .glb or .gltf files
    #[arg(required_unless_present_any = ["pool", "situation"])]
    scenes: Vec<PathBuf>,
    /// Kind of the scenes: objects seen from around them, or rooms seen from inside [default: room with --box, else object]
    #[arg(long, value_enum)]
    preset: Option<Preset>,
    /// Select from captures of photos instead of planning; every eighth photo is held out
    #[arg(long, value_name = "CAPTURES", num_args = 1.., conflicts_with_all = ["scenes", "preset", "box_", "clearance", "env", "surface", "space", "size", "light", "spp", "input_spp", "test_spp", "tests", "viewers", "situation", "keep_out", "wall", "heights", "walk"])]
    pool: Vec<PathBuf>,
    /// In a room, cameras and test views stand in a box: corners X0,Y0,Z0,X1,Y1,Z1 [default: the room's bounds less the clearance]
    #[arg(long = "box", value_delimiter = ',', allow_hyphen_values = true, value_name = "NUMBERS")]
    box_: Option<Vec<f64>>,
    /// In a room, no camera closer than this to the surface [default: a twentieth of the room's smallest side]
    #[arg(long)]
    clearance: Option<f64>,
    /// Folder for the tables and all results. An evaluation that was stopped continues there, and finished results are kept
    #[arg(long)]
    out: PathBuf,
    /// Environment map that lights all scenes: an equirectangular .hdr file, +Y up
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Methods to compare: any --method of `camsplat plan`, ours:KEY=VALUE or paper:KEY=VALUE (with a key of its configuration changed),
    /// each also as METHOD@DEGREES (with a lens of another field of view), or cameras:FILE, a layout of your own in any format that
    /// `camsplat capture` reads, with the lens of the others (lenses:FILE: with its own); in FILE, {scene}, {views} and {seed} stand for
    /// those of a run, and NAME=cameras:FILE is called NAME in tables [default: random, fibonacci, fvs, fvs-chord, fvs-shared, acp,
    /// fisherrf, fisherrf-retrain, cover, manifold, paper-iterative, paper-no-vds, paper, ours; rooms: without fibonacci and manifold;
    /// pools: random, fvs, coverage, acp, fisherrf, cover, ours; quick: random, fvs, ours]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    methods: Option<Vec<Competitor>>,
    /// Numbers of views [default: 50,100; rooms 300; pools 20,40; quick: 20; rooms 30]
    #[arg(long, value_delimiter = ',', value_name = "NUMBERS")]
    budgets: Option<Vec<u32>>,
    /// Runs of each method, for confidence intervals
    #[arg(long, default_value_t = 3)]
    seeds: u32,
    /// Seed of the first run: an evaluation can be split over several machines with the same device, and their scene folders
    /// copied into one
    #[arg(long, default_value_t = 0, value_name = "SEED")]
    first_seed: u32,
    /// Small images and short training: minutes on two cores
    #[arg(long)]
    quick: bool,
    /// Surface that methods plan on [default: proxy; quick rooms: true]
    #[arg(long, value_enum)]
    surface: Option<Shown>,
    /// Space in which methods place cameras; test views are from all of the region [default: open]
    #[arg(long, value_enum)]
    space: Option<Space>,
    /// Side of the images in pixels [default: 800; quick: 96]
    #[arg(long, value_name = "PIXELS")]
    size: Option<u32>,
    /// Diffuse light of the photographs: baked once for all of a scene, or traced for each pixel [default: rooms baked, objects traced]
    #[arg(long, value_enum)]
    light: Option<Light>,
    /// Samples per pixel, at least where light is baked [default: baked 64, traced 256; quick: 8]
    #[arg(long)]
    spp: Option<u32>,
    /// Samples per pixel of the input photos [default: as --spp; traced rooms at least 1024, since path-traced photos of few samples
    /// are noisier than a camera's; quick: as --spp]
    #[arg(long)]
    input_spp: Option<u32>,
    /// Samples per pixel of the test views, whose noise limits every score [default: as --spp]
    #[arg(long)]
    test_spp: Option<u32>,
    /// Input photos: the surface, its scores and the model of methods that need one are made from them; they are not trained on
    /// [default: 10; rooms 30]
    #[arg(long)]
    inputs: Option<u32>,
    /// Where around an object the input photos are taken [default: uniform]
    #[arg(long, value_enum)]
    inputs_from: Option<InputsFrom>,
    /// Test views of each set: three of objects, one of rooms [default: 200; quick: 12]
    #[arg(long)]
    tests: Option<u32>,
    #[command(flatten)]
    viewers: ViewerOptions,
    /// Surroundings in which objects are photographed, or built-in rooms. Floors, walls and blocks become part of the scene, and
    /// cameras and viewers respect them [default: free]
    #[arg(long, value_enum)]
    situation: Option<Situation>,
    #[command(flatten)]
    limits: LimitOptions,
    /// Downsampling factor of a pool's photos [default: 1; quick: 8]
    #[arg(long, requires = "pool")]
    shrink: Option<u32>,
    /// Training iterations [default: 30000; quick: 300]
    #[arg(long)]
    iterations: Option<u32>,
    /// Maximum number of splats [default: 1000000; quick: 5000]
    #[arg(long)]
    max_splats: Option<u32>,
    /// Train with Mip-Splatting's filter, which helps views from farther away than the photos
    #[arg(long)]
    antialiased: bool,
    /// Also measure LPIPS with VGG16, with these weights (safetensors, made by scripts/make_lpips_weights.py); finished trainings
    /// are reused
    #[arg(long, value_name = "FILE")]
    lpips_vgg: Option<PathBuf>,
    /// The paper's protocol, with every method of its tables and baselines on the outer sphere; LPIPS is AlexNet's without
    /// --lpips-vgg
    #[arg(long, conflicts_with_all = ["quick", "pool"])]
    paper: bool,
    /// Where around an object baselines may place cameras; the planner always has the whole region [default: region; paper: sphere]
    #[arg(long, value_enum)]
    baselines_from: Option<BaselinesFrom>,
    /// Make what methods choose on and nothing else, for methods of other programs: the surface, the region and the input photos as
    /// files in OUT/SCENE/task
    #[arg(long, conflicts_with_all = ["pool", "shard", "devices"])]
    prepare: bool,
    /// Devices to spread the runs over, each by index or part of its name
    #[arg(long, value_delimiter = ',', value_name = "NAMES", conflicts_with = "device")]
    devices: Vec<String>,
    /// Make part I of N of the runs, for one of N machines; tables are written by the same command without this option, in the folder
    /// that they share or into which theirs are copied
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Samples of a pixel with which pictures of a room are as clean as a camera's.
const CLEAN: u32 = 1024;
/// Methods where none are named.
const USUAL: [&str; 14] = [
    "random",
    "fibonacci",
    "fvs",
    "fvs-chord",
    "fvs-shared",
    "acp",
    "fisherrf",
    "fisherrf-retrain",
    "cover",
    "manifold",
    "paper-iterative",
    "paper-no-vds",
    "paper",
    "ours",
];
const OF_POOLS: [&str; 7] = ["random", "fvs", "coverage", "acp", "fisherrf", "cover", "ours"];
const QUICK: [&str; 3] = ["random", "fvs", "ours"];

impl Arguments {
    fn preset(&self) -> Preset {
        let is_room = self.box_.is_some() || self.situation().is_room();
        self.preset.unwrap_or(if is_room { Preset::Room } else { Preset::Object })
    }

    fn situation(&self) -> Situation {
        self.situation.unwrap_or_default()
    }

    /// Refuses scenes where the situation has its own, and none where it has not.
    fn check_scenes(&self) -> Result<()> {
        match (self.situation, self.scenes.is_empty() && self.pool.is_empty()) {
            (Some(room), false) if room.is_room() => {
                let name = room.name();
                Err(Error::request(format!("--situation {name}: it is a scene by itself; leave the scenes out")))
            }
            (Some(room), true) if room.is_room() => Ok(()),
            (_, false) => Ok(()),
            _ => Err(Error::request("there are no scenes; give some objects (.glb, .gltf)")),
        }
    }

    fn request(&self) -> Result<EvaluationRequest> {
        let kind = if self.pool.is_empty() { Kind::of(self.preset()) } else { Kind::Pool };
        let shape = self.box_.as_deref().map(box_of).transpose()?;
        let usual: &[&str] = match kind {
            _ if self.quick => &QUICK,
            Kind::Pool => &OF_POOLS,
            _ => &USUAL,
        };
        let named = || {
            let methods = usual.iter().filter_map(|name| name.parse().ok());
            methods.filter(|method: &Competitor| method.check(kind).is_ok()).collect()
        };
        let budgets = || match (kind, self.quick) {
            (Kind::Object, false) => vec![50, 100],
            (Kind::Room, false) => vec![300],
            (Kind::Pool, false) => vec![20, 40],
            (Kind::Room, true) => vec![30],
            (_, true) => vec![20],
        };
        let of = if self.quick { EvaluationSettings::QUICK } else { EvaluationSettings::WHOLE };
        let light = self.light.unwrap_or(if kind == Kind::Room { Light::Baked } else { Light::Traced });
        let usual = if self.quick { of.samples } else { light.samples() };
        let samples = self.spp.unwrap_or(usual);
        // Indoors, photos of so few samples are too noisy to be matched.
        // Ten photos of a floor or a wall give no surface to speak of, nor do noisy ones.
        let is_furnished = kind == Kind::Object && self.situation().furnishes();
        let shown = if self.quick && kind == Kind::Room || is_furnished { Shown::True } else { of.shown };
        Ok(EvaluationRequest {
            kind,
            methods: self.methods.clone().unwrap_or_else(named),
            budgets: self.budgets.clone().unwrap_or_else(budgets),
            seeds: self.seeds,
            first_seed: self.first_seed,
            settings: EvaluationSettings {
                size: self.size.unwrap_or(of.size),
                fov_deg: of.fov_deg,
                degree: of.degree,
                light,
                samples,
                input_samples: self.input_spp.unwrap_or(match kind {
                    Kind::Room if !self.quick && light == Light::Traced => samples.max(CLEAN),
                    _ => samples,
                }),
                test_samples: self.test_spp.unwrap_or(samples),
                inputs: self.inputs.unwrap_or(if kind == Kind::Room { 30 } else { of.inputs }),
                inputs_from: self.inputs_from.unwrap_or(of.inputs_from),
                tests: self.tests.unwrap_or(of.tests),
                iterations: self.iterations.unwrap_or(of.iterations),
                max_splats: self.max_splats.unwrap_or(of.max_splats),
                shown: self.surface.unwrap_or(shown),
                space: self.space.unwrap_or_default(),
                shrink: self.shrink.unwrap_or(of.shrink),
                baselines_from: self.baselines_from.unwrap_or(match (self.paper, kind) {
                    (true, Kind::Object) => BaselinesFrom::Sphere,
                    _ => of.baselines_from,
                }),
                region: RegionChoice { shape, floor: None, clearance: self.clearance, stood: None },
                antialiased: self.antialiased,
            },
            viewers: self.viewers.given()?.unwrap_or_else(|| self.situation().viewers()),
            situation: self.situation(),
            limits: self.limits.read(Limits::default(), |file| {
                Err(Error::input(file, "scenes of an evaluation lie nowhere on Earth; give a mesh or boxes"))
            })?,
        })
    }

    /// The scenes' names in tables and in the files of layouts.
    fn names(&self) -> Vec<String> {
        let room = self.situation();
        let room = room.is_room().then(|| PathBuf::from(room.name()));
        self.scenes.iter().chain(&room).map(|path| Scene::name_of(path)).collect()
    }

    /// Reads all that is evaluated on; the notes say what was understood.
    fn subjects(&self, request: &EvaluationRequest, notes: &mut Vec<String>) -> Result<Vec<Subject>> {
        let environment = self.env.as_deref().map(|path| read_environment(path, notes)).transpose()?;
        let intrinsics = request.settings.intrinsics();
        for method in &request.methods {
            if let Competitor::Cameras(given) = method {
                notes.extend(given.notes.iter().map(|note| format!("{method}: {note}")));
            }
        }
        let setting = Setting {
            preset: self.preset(),
            choice: request.settings.region,
            situation: request.situation,
            limits: request.limits.clone(),
        };
        let mut subjects = Vec::new();
        for path in &self.scenes {
            let scene = Scene::read(path, &setting, environment.as_ref(), &intrinsics, notes)?;
            if scene.in_studio {
                notes.push(format!("{}: no lamps and no --env: the built-in studio lights it", path.display()));
            }
            subjects.push(Subject::Scene(Box::new(scene)));
        }
        if let Some(model) = request.situation.rooms() {
            let surface = model.surface();
            let scene = Scene::new(
                Path::new(&request.situation.name()),
                &setting,
                (model, environment.as_ref()),
                surface,
                &intrinsics,
            )?;
            subjects.push(Subject::Scene(Box::new(scene)));
        }
        for path in &self.pool {
            subjects.push(Subject::Pool(Box::new(Pool::read(path, request, notes)?)));
        }
        Ok(subjects)
    }
}

impl Arguments {
    /// The request, as far as it can be checked before a scene is read.
    ///
    /// # Errors
    /// In a line that names the option.
    pub fn checked(&self) -> Result<EvaluationRequest> {
        self.check_scenes()?;
        let mut request = self.request()?;
        request.validate()?;
        // Before any is read: a box that is of another room would be called wrong first.
        request.check_subjects((self.scenes.len() + self.pool.len()).max(1))?;
        // Who asks for what methods choose on has no layouts yet.
        if !self.prepare {
            request.read_layouts(&self.names())?;
            request.validate()?;
        }
        for file in self.scenes.iter().chain(&self.env) {
            io::check_there(file)?;
        }
        Ok(request)
    }
}

/// Evaluates, writes and prints the tables.
pub fn run(arguments: &Arguments) -> Result<Ended> {
    let request = arguments.checked()?;
    if arguments.devices.iter().any(|name| name.trim().is_empty()) {
        return Err(Error::request(
            "--devices: an empty name names no device; give numbers or names, as `camsplat devices` has them",
        ));
    }
    let weights = arguments.lpips_vgg.as_deref().map(|file| Weights::read(file, Network::Vgg)).transpose()?;
    let mut notes = Vec::new();
    let subjects = arguments.subjects(&request, &mut notes)?;
    let shard = arguments.shard.unwrap_or(Shard::WHOLE);
    // Files for other methods leave tables as they are.
    destination::check(&arguments.out, &request, &subjects, shard.is_whole() && !arguments.prepare)?;
    for note in &notes {
        say!("{note}");
    }
    let contexts = match &arguments.devices[..] {
        [] => vec![arguments.device.open()?],
        names => arguments.device.open_each(names)?,
    };
    for context in &contexts {
        say!("device   {}", context.physical().title());
    }
    stop_on_interrupt()?;
    let start = Instant::now();
    let (mut made, mut kept) = (0, 0);
    let mut page = Page::new(&arguments.out, &request, &subjects);
    // Devices are worked on by threads of their own, which are in this session too.
    let session = session::current();
    let mut observe = |event: EvaluationEvent<'_>| {
        match event {
            EvaluationEvent::Artifact(ArtifactEvent::Begins(product)) => {
                made += 1;
                say!("making   {product}, after {:.0} s", start.elapsed().as_secs_f64());
            }
            EvaluationEvent::Artifact(ArtifactEvent::Kept) => kept += 1,
            EvaluationEvent::Artifact(ArtifactEvent::Note(note)) => say!("note     {note}"),
            EvaluationEvent::Artifact(ArtifactEvent::Working) => {}
            EvaluationEvent::Complete(entry, [done, all]) => {
                let Entry { scene, method, views, seed, folder, .. } = entry;
                say!("complete {scene}, {method}, {views} views, seed {seed}: {folder} ({done} of {all})");
                if let Some(listener) = session.listener() {
                    listener.progress("evaluating", done as u64, all as u64);
                }
            }
            EvaluationEvent::Written(outcome) => page.show(outcome),
        }
        go_on()
    };
    if arguments.prepare {
        let prepared = task::prepare(&contexts[0], &request, &subjects, &arguments.out, &mut |event| {
            session.within(|| observe(EvaluationEvent::Artifact(event)))
        });
        contexts.iter().for_each(|context| print_messages(context));
        return prepared_as(prepared, &arguments.out, &subjects);
    }
    let outcome =
        evaluation::run(&contexts, &request, &subjects, shard, &arguments.out, weights.as_ref(), &mut |event| {
            session.within(|| observe(event))
        });
    contexts.iter().for_each(|context| print_messages(context));
    let written = page.finish();
    let outcome = match outcome {
        Err(Error::Interrupted) => {
            say!("{}", super::STOPPED);
            if let Some(page) = written? {
                say!("written  {}, {}, of what is complete", arguments.out.join("table.md").display(), page.display());
            }
            return Ok(Ended::Stopped);
        }
        outcome => outcome?,
    };
    let page = written?;
    say!("results  {made} made, {kept} reused, in {:.0} s", start.elapsed().as_secs_f64());
    if !shard.is_whole() {
        if outcome.entries.is_empty() {
            say!("note     shard {shard} has no runs: there are fewer runs than shards");
        }
        say!("complete shard {shard}; once all are, the same command without --shard writes the tables");
        return Ok(Ended::Done);
    }
    say!("{}", table::markdown(&request, &outcome).trim_end());
    if let Some(page) = page {
        say!("written  {}, {}", arguments.out.join("table.md").display(), page.display());
    }
    Ok(Ended::Done)
}

/// Says where the files for other methods lie.
fn prepared_as(prepared: Result<()>, out: &Path, subjects: &[Subject]) -> Result<Ended> {
    match prepared {
        Err(Error::Interrupted) => {
            say!("{}", super::STOPPED);
            return Ok(Ended::Stopped);
        }
        prepared => prepared?,
    }
    for subject in subjects {
        say!("written  {}", out.join(subject.name()).join("task").display());
    }
    say!(
        "next     in place of --prepare, NAME=cameras:DIR/{{scene}}-{{views}}-{{seed}}.json among --methods, with the cameras that yours chooses"
    );
    Ok(Ended::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a method that the help promises would be left out without a word.
    #[test]
    fn every_usual_method_fits_its_kind() {
        for (kind, names) in [(Kind::Object, &USUAL[..]), (Kind::Pool, &OF_POOLS), (Kind::Room, &QUICK)] {
            for name in names {
                name.parse::<Competitor>().unwrap().check(kind).unwrap();
            }
        }
    }
}
