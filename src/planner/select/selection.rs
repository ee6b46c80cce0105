//! A whole selection: what the pool sees, the photos chosen, the baselines beside them, from a capture to a record.

use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::information::Model;
use super::interchange::refine;
use super::objective::Objective;
use super::pool::Pool;
use super::request::SelectionRequest;
use super::rule::{Means, Rule};
use super::score::SubsetScorer;
use super::sight::Survey;
use crate::engine::vulkan::Context;
use crate::files::photos::PhotoSet;
use crate::planner::methods::Method;
use crate::planner::metrics::score_point::aggregate;
use crate::planner::metrics::{Metrics, PointMetrics};
use crate::planner::plan::config::{Config, Preset};
use crate::planner::plan::pipeline;
use crate::planner::plan::preparation::PROBE_STREAM;
use crate::planner::plan::problem::Problem;
use crate::planner::plan::record::BaselineRecord;
use crate::planner::plan::record::Expected;
use crate::planner::plan::target::Target;
use crate::planner::quality::expected::{Expectation, Judge};
use crate::planner::quality::law::{Fitted, Law};
use crate::planner::quality::look::Surroundings;
use crate::planner::quality::map::{ErrorMap, error_map};
use crate::planner::quality::viewers::Viewers;
use crate::scene::camera::{Camera, Pose, middle_lens};
use crate::scene::proxy::{Occluder, Proxy, SurfacePoint};
use crate::visibility::device_scene::DeviceScene;
use crate::{Error, Result};

/// Stream of the held-out points, as a plan has it.
const HELD_OUT_STREAM: u32 = 1;
/// Simple choices that swaps begin from and are never worse than.
const SIMPLE: [Method; 5] = [Method::Assigned, Method::Fvs, Method::FvsChord, Method::Coverage, Method::Random];
/// Viewers that a choice is made for, and others that it is judged by.
const VIEWERS: u32 = 256;
const JUDGES: u32 = 512;
/// Key that separates these.
const JUDGE_SEED: u64 = 0x6a75_6467;
/// What all of a choice's photos are worth if they are the sharpest and not the least sharp, in decibels: more error than that
/// no swaps take on for sharpness.
const SHARPNESS_DB: f64 = 0.5;

/// A photo that was chosen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Chosen {
    /// Index into the set.
    pub photo: usize,
    /// Decibels of expected quality that would be lost without it.
    pub contribution_db: f64,
    /// Its sharpness, where requested.
    pub sharpness: Option<f64>,
}

/// A photo worth taking.
#[derive(Clone, Debug, PartialEq)]
pub struct Suggested {
    /// Where from.
    pub camera: Camera,
    /// Decibels of expected quality that it would add to the choice by itself.
    pub gain_db: f64,
}

/// A simple choice and what is expected of it.
struct Simple {
    method: Method,
    subset: Vec<usize>,
    expectation: Expectation,
}

/// Cameras planned beside those that are kept, in the user's world; none where no choice needs them.
#[derive(Default)]
struct Planned {
    /// By expected quality.
    own: Vec<Pose>,
    /// By the paper's objective, for the choice that the paper makes.
    paper: Vec<Pose>,
}

/// What was chosen and how good it is.
pub struct Selection {
    /// The chosen photos, ascending.
    pub chosen: Vec<Chosen>,
    /// Expected error in decibels, before the swaps and after each, against its first value.
    pub errors_db: Vec<f64>,
    /// What is expected of the choice, against the best of the simple ones.
    pub expected: Expected,
    /// Where it leaves error, by held-out point among others.
    pub map: ErrorMap,
    /// Held-out points.
    pub points: Vec<SurfacePoint>,
    /// What the choice gives each of them.
    pub scores: Vec<PointMetrics>,
    /// Metrics of the choice.
    pub metrics: Metrics,
    /// Metrics of the whole pool: what cannot be surpassed.
    pub pool: Metrics,
    /// Metrics of the other methods on the same points.
    pub baselines: Vec<BaselineRecord>,
    /// Wall time in seconds of: finding out what the pool sees, planning, choosing.
    pub seconds: [f64; 3],
    /// Bytes of the matrices of visibility and of what the swaps keep.
    pub bytes: usize,
}

/// A capture, its surface, and what all photos see of it.
pub struct SelectionContext<'a> {
    context: Arc<Context>,
    set: &'a PhotoSet,
    target: &'a Target,
    scene: DeviceScene,
    request: SelectionRequest,
    survey: Survey,
    held_out: Survey,
    model: Option<Model>,
    seconds: f64,
}

impl<'a> SelectionContext<'a> {
    /// Computes which photos see which points.
    ///
    /// # Errors
    /// A request that does not fit the pool, a surface of which no photo pair sees any point, or a device that fails.
    pub fn new(
        context: &Arc<Context>,
        set: &'a PhotoSet,
        target: &'a Target,
        request: SelectionRequest,
    ) -> Result<Self> {
        request.validate(set.photos.len())?;
        let start = Instant::now();
        let scene = DeviceScene::new(context, target.geometry()?)?;
        // Both samples follow the same law and share no point: of a cloud, each comes from a half of its own.
        let count = (request.points as usize).min(half(&target.proxy)).max(1);
        let (cameras, inward) = (set.cameras(), request.preset == Preset::Object);
        let lens = middle_lens(&cameras).ok_or_else(|| Error::request("there are no photos"))?;
        let viewers = request.viewers.clone().unwrap_or(Viewers::Cameras(cameras));
        let sample = |stream| {
            let points = target.proxy.sample(count, request.seed, stream);
            viewers.facing(points, &scene.geometry, lens, inward)
        };
        let survey = Survey::new(context, &scene, &set.photos, sample(PROBE_STREAM)?)?;
        if (0..survey.points.len()).all(|point| survey.sight.photos_that_see(point).count() < 2) {
            return Err(Error::input(
                &set.path,
                "no point of the surface is seen by two photos; do surface and photos share a frame?",
            ));
        }
        let held_out = Survey::new(context, &scene, &set.photos, sample(HELD_OUT_STREAM)?)?;
        let seconds = start.elapsed().as_secs_f64();
        Ok(Self { context: context.clone(), set, target, scene, request, survey, held_out, model: None, seconds })
    }

    /// Also has trained splats of the scene, for the methods that choose by them.
    pub fn with_model(self, model: Option<Model>) -> Self {
        Self { model, ..self }
    }

    /// Plans cameras beside those that are kept, with the lens in the middle of the pool's; in the user's world.
    ///
    /// # Errors
    /// Where the plan does not fit the device, or the device fails.
    fn plan(&self, base: Config, kept: &[Camera], viewers: Viewers) -> Result<Vec<Pose>> {
        let (Some(lens), true) = (middle_lens(&self.set.cameras()), base.views > 0) else { return Ok(Vec::new()) };
        let config = Config { seed: self.request.seed, viewers, checkpoint_every: base.iterations, ..base };
        let problem = Problem { viewers_lens: lens, ..Problem::new(self.target, lens, kept)? };
        match config.of_quality() {
            Some(_) => Ok(pipeline::expected_plan(&self.context, &problem, config)?.1),
            None => pipeline::poses(&self.context, &problem, config),
        }
    }

    /// The plans that the choice needs.
    fn planned(&self, rule: Option<Rule>, kept: &[Camera], viewers: &Viewers, with_baselines: bool) -> Result<Planned> {
        let (preset, views) = (self.request.preset, (self.request.count - kept.len()) as u32);
        let mut planned = Planned::default();
        if with_baselines || matches!(rule, None | Some(Rule::Assigned)) {
            planned.own = self.plan(Config::new(preset, views), kept, viewers.clone())?;
        }
        if with_baselines || rule == Some(Rule::Nearest) {
            planned.paper = self.plan(Config::paper(preset, views), kept, viewers.clone())?;
        }
        Ok(planned)
    }

    /// Viewers of a choice, for making it and for judging it: of a pool every other photo each.
    fn viewers(&self) -> [Viewers; 2] {
        let photos = self.set.photos.len();
        let pool = |half: usize| match photos {
            // Too few to be split.
            0..8 => Viewers::Cameras(self.cameras(&(0..photos).collect::<Vec<_>>())),
            _ => Viewers::Cameras(self.cameras(&(half..photos).step_by(2).collect::<Vec<_>>())),
        };
        [0, 1].map(|half| self.request.viewers.clone().unwrap_or_else(|| pool(half)))
    }

    fn cameras(&self, subset: &[usize]) -> Vec<Camera> {
        subset.iter().map(|photo| self.set.photos[*photo].camera.clone()).collect()
    }

    /// So many viewers with what they look at.
    fn judge(&self, viewers: &Viewers, seed: u64, count: u32) -> Result<Judge<'_>> {
        let inward = self.request.preset == Preset::Object;
        let (geometry, law) = (&self.scene.geometry, Law::embedded(inward));
        let lens = middle_lens(&self.set.cameras()).ok_or_else(|| Error::request("there are no photos"))?;
        let viewers = viewers.sample(geometry, lens, inward, seed, count)?;
        Judge::new(&self.context, &self.scene, self.surroundings(&law), viewers, &law, seed)
    }

    fn surroundings(&self, law: &Law) -> Surroundings {
        let inward = self.request.preset == Preset::Object;
        Surroundings::new(&self.scene.geometry, self.target.proxy.sphere, inward, law)
    }

    /// Poses worth adding to a choice, planned with the chosen photos as cameras that are there already: those that help most by
    /// themselves first, each with the decibels of expected quality that it alone would add.
    ///
    /// # Errors
    /// Where the plan does not fit the device, or the device fails.
    pub fn suggest(&self, chosen: &[Chosen], count: usize) -> Result<Vec<Suggested>> {
        let kept = self.cameras(&chosen.iter().map(|chosen| chosen.photo).collect::<Vec<_>>());
        let Some(intrinsics) = middle_lens(&self.set.cameras()) else { return Ok(Vec::new()) };
        // A photo is worth taking where no photo of the pool looks.
        let viewers = self.request.viewers.clone().unwrap_or_default();
        let judge = self.judge(&viewers, self.request.seed ^ JUDGE_SEED, JUDGES)?;
        let without = judge.expect(&kept)?.error_db;
        let alone = |pose: Pose| {
            let camera = Camera { name: String::new(), pose, intrinsics };
            let error = judge.expect(&[&kept[..], std::slice::from_ref(&camera)].concat())?.error_db;
            Ok(Suggested { camera, gain_db: without - error })
        };
        let poses = self.plan(Config::new(self.request.preset, count as u32), &kept, viewers)?;
        let mut suggested = poses.into_iter().map(alone).collect::<Result<Vec<_>>>()?;
        suggested.sort_by(|a, b| b.gain_db.total_cmp(&a.gain_db));
        for (i, one) in suggested.iter_mut().enumerate() {
            one.camera.name = format!("suggested_{i:04}.png");
        }
        Ok(suggested)
    }

    /// Chooses, and scores the choice beside the baselines. `sharpness` is a value per photo, greater for sharper ones.
    ///
    /// # Errors
    /// Where a plan does not fit the device, the device fails, or the method does not fit the pool.
    pub fn select(&self, sharpness: Option<&[f64]>, with_baselines: bool) -> Result<Selection> {
        let request = &self.request;
        let allowed: Vec<usize> =
            (0..self.set.photos.len()).filter(|photo| request.exclude.binary_search(photo).is_err()).collect();
        let pool = Pool {
            set: self.set,
            region: &self.target.region,
            sight: &self.survey.sight,
            include: &request.include,
            allowed: &allowed,
            count: request.count,
            seed: request.seed,
        };
        let start = Instant::now();
        let kept: Vec<Camera> = request.include.iter().map(|photo| self.set.photos[*photo].camera.clone()).collect();
        let rule = self.rule()?;
        let [viewers, judges] = self.viewers();
        let planned = self.planned(rule, &kept, &viewers, with_baselines)?;
        let planning = start.elapsed().as_secs_f64();

        let start = Instant::now();
        let judge = self.judge(&judges, request.seed ^ JUDGE_SEED, JUDGES)?;
        let simple = self.simple(&pool, &planned, &judge)?;
        let looked_at = self.judge(&viewers, request.seed, VIEWERS)?;
        let law = Law::embedded(request.preset == Preset::Object);
        let plain = Objective::new(
            &self.context,
            &self.scene,
            &self.set.photos,
            looked_at.looks()?,
            looked_at.viewers().len(),
            law,
        )?;
        if plain.looks() == 0 {
            return Err(Error::request(
                "viewers: none of them has the surface in a sixteenth of its picture; give nearer ones (`viewers`), in the surface's frame",
            ));
        }
        let (mut subset, mut errors_db) = match rule {
            None => swap(&pool, &plain, &simple, sharpness),
            Some(rule) => (self.by(rule, &pool, &planned)?, Vec::new()),
        };
        let mut expectation = judge.expect(&self.cameras(&subset))?;
        // Judged by viewers that no swap was made for; what is bought with sharpness is not seen by them.
        let better = |best: &&Simple| sharpness.is_none() && best.expectation.error_db < expectation.error_db;
        if let Some(best) = simple.first().filter(|_| rule.is_none()).filter(better) {
            (subset, expectation, errors_db) = (best.subset.clone(), best.expectation.clone(), vec![0.0]);
        }
        let others = simple.iter().find(|one| one.method != request.method);
        let db = others.map_or(0.0, |best| best.expectation.error_db - expectation.error_db);
        let expected = Expected {
            db,
            sd: Fitted::embedded(request.preset == Preset::Object).spread(db),
            unseen: expectation.unseen,
            against: others.map_or("", |best| best.method.name()).into(),
            reason: None,
        };
        subset.sort_unstable();
        let cameras = self.cameras(&subset);
        let places: Vec<DVec3> = self.held_out.points.iter().map(|point| point.position).collect();
        let (_, map) = error_map(&judge, &self.scene.geometry, self.surroundings(&law), &law, &cameras, &places)?;
        let choosing = start.elapsed().as_secs_f64();

        let choice = plain.choose(&subset);
        let chosen = subset
            .iter()
            .zip(choice.losses())
            .map(|(&photo, loss)| Chosen {
                photo,
                contribution_db: loss,
                sharpness: sharpness.map(|sharpness| sharpness[photo]),
            })
            .collect();
        let world = 1.0 / self.scene.geometry.to_internal.scale;
        let scorer = SubsetScorer::new(&self.held_out, self.set, world);
        let scores = scorer.score(&subset);
        let mut baselines = Vec::new();
        for method in Method::BASELINES.into_iter().filter(|method| with_baselines && *method != request.method) {
            // A baseline that does not fit the scene (a sphere in a room) is no reason to fail.
            if let Some(Ok(subset)) = method.rule().map(|rule| self.by(rule, &pool, &planned)) {
                baselines
                    .push(BaselineRecord { name: method.name().into(), metrics: aggregate(&scorer.score(&subset)) });
            }
        }
        let everything: Vec<usize> = (0..self.set.photos.len()).collect();
        Ok(Selection {
            chosen,
            errors_db,
            expected,
            map,
            metrics: aggregate(&scores),
            scores,
            pool: aggregate(&scorer.score(&everything)),
            points: self.held_out.points.clone(),
            baselines,
            seconds: [self.seconds, planning, choosing],
            bytes: plain.bytes() + self.survey.sight.bytes() + self.held_out.sight.bytes(),
        })
    }

    /// Simple choices of as many photos as requested, the best of them by expected quality first.
    fn simple(&self, pool: &Pool<'_>, planned: &Planned, judge: &Judge<'_>) -> Result<Vec<Simple>> {
        let plans = planned.own.len() + pool.include.len() == pool.count;
        let mut simple = Vec::new();
        for method in SIMPLE.into_iter().filter(|method| plans || *method != Method::Assigned) {
            // A method that does not fit the pool is no reason to fail.
            let Some(Ok(subset)) = method.rule().map(|rule| self.by(rule, pool, planned)) else { continue };
            if subset.len() == pool.count {
                let expectation = judge.expect(&self.cameras(&subset))?;
                simple.push(Simple { method, subset, expectation });
            }
        }
        simple.sort_by(|a, b| a.expectation.error_db.total_cmp(&b.expectation.error_db));
        Ok(simple)
    }

    /// The choice of a rule.
    fn by(&self, rule: Rule, pool: &Pool<'_>, planned: &Planned) -> Result<Vec<usize>> {
        let planned = if rule == Rule::Nearest { &planned.paper } else { &planned.own };
        let means = Means {
            context: &self.context,
            geometry: &self.scene.geometry,
            proxy: &self.target.proxy,
            planned,
            model: self.model.as_ref(),
            photograph: &mut |photo| Ok(photo.clone()),
        };
        rule.choose(pool, means)
    }

    /// The rule of the requested method; none where swaps choose.
    fn rule(&self) -> Result<Option<Rule>> {
        let method = self.request.method;
        match (method, method.rule()) {
            (Method::Ours, _) => Ok(None),
            (_, Some(Rule::FisherRetrain(usual))) => {
                Ok(Some(Rule::FisherRetrain(self.request.retraining.unwrap_or(usual))))
            }
            (_, Some(rule)) => Ok(Some(rule)),
            (_, None) => {
                let name = method.name();
                Err(Error::request(format!("`method` {name}: it places cameras and chooses no photos")))
            }
        }
    }
}

/// Swaps from the best of the simple choices, and what they gained, in decibels.
fn swap(pool: &Pool<'_>, plain: &Objective, simple: &[Simple], sharpness: Option<&[f64]>) -> (Vec<usize>, Vec<f64>) {
    let Some(start) = simple.first() else { return (pool.random(), Vec::new()) };
    let mut objective = plain.clone();
    if let Some(sharpness) = sharpness {
        let worth = SHARPNESS_DB / pool.count as f64;
        objective = objective.with_prices(blur(sharpness).into_iter().map(|blur| worth * blur).collect());
    }
    // Photos that are chosen in any case keep their slots.
    let is_must = |photo: &usize| pool.include.binary_search(photo).is_ok();
    let mut subset = start.subset.clone();
    subset.sort_by_key(|photo| !is_must(photo));
    let fixed: Vec<bool> = subset.iter().map(is_must).collect();
    let mut choice = objective.choose(&subset);
    let errors = refine(&mut choice, pool.allowed, &fixed);
    (choice.chosen().to_vec(), errors.iter().map(|error| error - errors[0]).collect())
}

/// Discs in the smaller of the halves that samples are drawn from; no bound for triangles.
fn half(proxy: &Proxy) -> usize {
    let Occluder::Discs(discs) = &proxy.occluder else { return usize::MAX };
    let open = |parity: usize| {
        (parity..discs.len()).step_by(2).filter(|i| !proxy.buried.get(*i).is_some_and(|buried| *buried)).count()
    };
    open(0).min(open(1))
}

/// Rank of each photo by its lack of sharpness: 0 for the sharpest, 1 for the least sharp. Ranks, since the variance of the
/// Laplacian depends on what is in the image as much as on its focus.
fn blur(sharpness: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..sharpness.len()).collect();
    order.sort_by(|a, b| sharpness[*b].total_cmp(&sharpness[*a]).then(a.cmp(b)));
    let mut blur = vec![0.0; sharpness.len()];
    for (rank, photo) in order.into_iter().enumerate() {
        blur[photo] = rank as f64 / sharpness.len().max(2).saturating_sub(1) as f64;
    }
    blur
}
