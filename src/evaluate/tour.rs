//! The whole way on one scene, step by step: photographs, a surface of them, scores, a plan for it, photographs from the plan,
//! splats trained on these, tests; and beside it the same from as many views at random.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use super::bench::{Bench, SURFACE};
use super::job::Outcome;
use super::kind::Kind;
use super::request::{Method, Request, Settings};
use super::results::{self, Entry};
use super::scene::Scene;
use super::stage::{self, Stage};
use crate::io::photos;
use crate::peers::request::Method as Placing;
use crate::photograph::products::named;
use crate::plan::job::{Plan, Target, Tools};
use crate::quality::viewers::Viewers;
use crate::scene::camera::Camera;
use crate::scene::surface::{Points, Surface};
use crate::vulkan::Context;
use crate::{Error, Result, io, plan, vds};

/// Seed of choices and training.
const SEED: u64 = 0;
/// Score in [1, 2] above which a point is told of as one that changes with the view.
const CHANGES: f32 = 1.2;

/// How large everything is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Size {
    /// Pictures, inputs, tests and training.
    pub settings: Settings,
    /// Views that are planned, and drawn at random.
    pub views: u32,
}

impl Size {
    /// What two cores do within one to three minutes, slow ones too.
    pub const DEMO: Self =
        Self { settings: Settings { inputs: 20, tests: 4, iterations: 250, ..Settings::QUICK }, views: 20 };
}

/// What was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// In a word.
    pub name: &'static str,
    /// What came out.
    pub what: String,
    /// How long it took.
    pub seconds: f64,
}

/// What happens on the way.
pub enum Event<'e> {
    /// A step is done.
    Done(&'e Step),
    /// One goes on.
    Working,
}

/// Hears what happens and says whether to go on.
pub type Observe<'o> = &'o mut (dyn FnMut(Event<'_>) -> ControlFlow<()> + Send);

/// Where the way led.
pub struct Tour {
    /// The scene's name, and that of the folder of its products.
    pub name: String,
    /// The steps in their order.
    pub steps: Vec<Step>,
    /// Photographs that the surface was made of, as files in the scene's folder.
    pub inputs: Vec<String>,
    /// PNG of the surface's scores.
    pub scores: Vec<u8>,
    /// What was planned for.
    pub target: Target,
    /// The plan.
    pub plan: Plan,
    /// Photographs from the plan's cameras, in the same way.
    pub photos: Vec<String>,
    /// The plan and the views at random, trained on and tested.
    pub outcome: Outcome,
}

/// Goes the whole way; products lie in the scene's folder below `folder`, and those that are there are taken as they are. None
/// where `observe` broke it off; the same call goes on from there.
///
/// # Errors
/// Where a step fails; what is finished stays.
pub fn run(context: &Arc<Context>, folder: &Path, size: Size, scene: &Scene, observe: Observe) -> Result<Option<Tour>> {
    let Size { settings, views } = size;
    let name = scene.name.clone();
    let intrinsics = settings.intrinsics();
    let random = Method::Plan(Placing::Random);
    let (kind, methods) = (Kind::Object, vec![Method::Plan(Placing::Ours), random]);
    let request = Request {
        kind,
        methods,
        budgets: vec![views],
        seeds: 1,
        first_seed: 0,
        settings,
        viewers: Viewers::Region,
        situation: scene.situation,
        limits: scene.limits.clone(),
    };
    let input_cameras = scene.inputs(context, &settings)?;
    let tests = scene.tests(intrinsics, settings.tests, request.test_viewers())?;
    let mut walk = Walk { observe, begun: Instant::now(), kept: false, steps: Vec::new() };
    let bench = Bench::new(context, &folder.join(&name), &request, scene)?;

    let Some(inputs) = bench.input_photographs(&input_cameras, &mut |event| walk.hear(&event))? else { return Ok(None) };
    let Settings { size: side, samples, .. } = settings;
    let taken = format!("{} photographs of {side} x {side} pixels, {samples} samples a pixel", settings.inputs);
    walk.done("photos", taken);

    let Some(shown) = bench.shown(&inputs, &mut |event| walk.hear(&event))? else { return Ok(None) };
    let target = bench.target(&shown, &scene.region, false)?;
    let points = read_points(&shown)?;
    walk.done("proxy", surface_and_scores(&points));
    let photographs = photos::read(inputs.folder(), &photos::Options::default())?.photos;
    let scores = vds::picture::scores(&points, &photographs)?;

    let config = Method::Plan(Placing::Ours).config(kind.preset(), views, SEED)?;
    let plan = plan::job::run(context, &target, intrinsics, &[], config, Tools::default(), |_| walk.work())?;
    if plan.interrupted() {
        return Ok(None);
    }
    walk.done("plan", gap_beside_controls(&plan));

    let Some(tests) = bench.test_photographs(&tests, &mut |event| walk.hear(&event))? else { return Ok(None) };
    walk.done("tests", format!("{} photographs of views that nobody chose", 3 * settings.tests));

    let trained = |walk: &mut Walk, (method, from): (Method, &str), cameras: &[Camera], seconds: f64| {
        let Some(photos) = bench.photographs(cameras, &mut |event| walk.hear(&event))? else { return Ok(None) };
        walk.done("photos", format!("{views} photographs from {from}"));
        let training = bench.training(&photos, Some(&tests), SEED, &mut |event| walk.hear(&event))?;
        let Some((stage, record)) = training else { return Ok(None) };
        walk.done("training", format!("{} splats in {} iterations, tested", record.splats, record.iterations));
        let quality = results::by_set(&record, kind.sets());
        let pictures = results::first_pictures(&record, kind.sets());
        let folder = stage.key().to_owned();
        let places = cameras.iter().map(|camera| camera.pose.position).collect();
        let (scene, came_apart) = (name.clone(), record.came_apart());
        let entry = Entry { scene, method, views, seed: SEED, seconds, quality, came_apart, folder, pictures, places };
        Ok::<_, Error>(Some((photos, entry)))
    };
    let ours = trained(
        &mut walk,
        (Method::Plan(Placing::Ours), "the planned views"),
        &plan.record.cameras,
        plan.record.seconds,
    )?;
    let Some((photos, ours)) = ours else { return Ok(None) };
    let drawn = bench.choice((random, views, SEED), (&inputs, &shown), None, &mut |event| walk.hear(&event))?;
    let Some(drawn) = drawn else { return Ok(None) };
    let Some((_, random)) = trained(&mut walk, (random, "as many views at random"), &drawn.cameras, drawn.seconds)?
    else {
        return Ok(None);
    };

    let entries = vec![ours, random];
    let outcome = Outcome::new(kind, entries, 2);
    let inputs = files(&inputs, &input_cameras)?;
    let photos = files(&photos, &plan.record.cameras)?;
    Ok(Some(Tour { steps: walk.steps, name, inputs, scores, target, plan, photos, outcome }))
}

/// Steps, told of as they are done.
struct Walk<'o> {
    observe: Observe<'o>,
    begun: Instant,
    /// Whether the step's product was there.
    kept: bool,
    steps: Vec<Step>,
}

impl Walk<'_> {
    fn hear(&mut self, event: &stage::Event<'_>) -> ControlFlow<()> {
        match event {
            stage::Event::Begins(_) => self.kept = false,
            stage::Event::Kept(_) => self.kept = true,
            stage::Event::Working | stage::Event::Note(_) => {}
        }
        self.work()
    }

    fn work(&mut self) -> ControlFlow<()> {
        (self.observe)(Event::Working)
    }

    fn done(&mut self, name: &'static str, mut what: String) {
        if self.kept {
            what += ", there from an earlier run";
        }
        let step = Step { name, what, seconds: self.begun.elapsed().as_secs_f64() };
        // A stop that is asked for here is heard within the next step.
        let _ = (self.observe)(Event::Done(&step));
        self.steps.push(step);
        (self.begun, self.kept) = (Instant::now(), false);
    }
}

/// The photographs of cameras.
fn files(stage: &Stage, cameras: &[Camera]) -> Result<Vec<String>> {
    let file = |camera: &Camera| format!("{}/images/{}", stage.key(), camera.name);
    Ok(named(cameras)?.iter().map(file).collect())
}

fn read_points(shown: &Stage) -> Result<Points> {
    let file = shown.file(SURFACE);
    match io::read_surface(&file)? {
        Surface::Points(points) => Ok(points),
        Surface::Mesh(_) => {
            Err(Error::input(file, "a cloud of points was written here; remove the folder and run again"))
        }
    }
}

fn surface_and_scores(points: &Points) -> String {
    let all = points.scores.len();
    let changing = points.scores.iter().filter(|score| **score > CHANGES).count();
    format!(
        "{all} points of a surface, from these photographs alone; {:.0}% of them change with the view (a score above {CHANGES})",
        100.0 * changing as f64 / all.max(1) as f64
    )
}

fn gap_beside_controls(plan: &Plan) -> String {
    let record = &plan.record;
    let beside: Vec<String> = record
        .controls
        .iter()
        .map(|control| format!("{} {:.1}°", control.name, control.metrics.gap_mean_deg))
        .collect();
    format!(
        "{} views for this surface; {:.1}° from a direction to the nearest view in the mean ({})",
        record.cameras.len(),
        record.metrics.gap_mean_deg,
        beside.join(", ")
    )
}
