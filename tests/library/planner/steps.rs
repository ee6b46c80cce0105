//! Several iterations on the device against as many of the twin: gradients, region, Adam, scale and schedule together.

use std::sync::Arc;

use crate::support::device::{context, silent};
use crate::support::plans::{Scene, planner, scene};
use camsplat::engine::vulkan::{Context, Recorder};
use camsplat::planner::plan::clock::Clock;
use camsplat::planner::plan::config::{Config, Preset};
use camsplat::planner::plan::gate::Gate;
use camsplat::planner::plan::paper::dense::{Batch, dense};
use camsplat::planner::plan::paper::regulariser::regulariser;
use camsplat::planner::plan::paper::scale::LearntScale;
use camsplat::planner::plan::paper::{Kernel, PaperConfig, PaperPass, Pass};
use camsplat::planner::plan::planner::Planner;
use camsplat::planner::plan::update::{Adam, update};
use camsplat::scene::octahedral;
use camsplat::scene::region::{Region, Shape};
use camsplat::scene::samples;
use glam::{DVec3, Vec3};

/// A shell so thin that the first steps lead out of it, above a floor.
fn thin_shell(context: &Arc<Context>, floor: f64) -> Scene {
    let shape = Shape::Shell { centre: DVec3::ZERO, r_min: 1.4, r_max: 1.5 };
    let region = Region { shape, up: DVec3::Z, floor: Some(floor), clearance: 0.05 };
    scene(context, &samples::object(), &region)
}

/// One iteration on the device.
fn iterate(context: &Arc<Context>, planner: &Planner) {
    let mut commands = Recorder::new(context).expect("a recorder");
    planner.record_iteration(&mut commands).expect("an iteration");
    commands.submit_and_wait().expect("an iteration");
}

/// The run in the twin.
struct Twin<'a> {
    planner: &'a Planner,
    paper: &'a PaperPass,
    scene: &'a Scene,
    depth: Vec<f64>,
    directions: Vec<DVec3>,
    splats: Vec<(DVec3, DVec3)>,
    moments: Vec<[Adam; 2]>,
    clock: Clock,
    scale: LearntScale,
    /// Splats of which a component of the gradient has been so small that rounding may have chosen its sign, and so the
    /// direction of Adam's step: what they do from then on is meaningless.
    noise: Vec<bool>,
    /// Terms of the loss in the last iteration: image, regulariser, region.
    terms: [f64; 3],
}

impl<'a> Twin<'a> {
    fn new(planner: &'a Planner, scene: &'a Scene) -> Self {
        let vector = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let splats: Vec<_> = planner.start().iter().map(|s| (vector(s.centre), vector(s.direction))).collect();
        let paper = planner.pass::<PaperPass>().expect("the paper's objective");
        Self {
            depth: paper.maps().download().expect("depths").into_iter().map(f64::from).collect(),
            directions: octahedral::directions(paper.maps().resolution),
            moments: vec![[Adam::default(); 2]; splats.len()],
            noise: vec![false; splats.len()],
            clock: Clock::new(planner.settings()),
            scale: LearntScale::new(f64::from(paper.start_scale())),
            terms: [0.0; 3],
            splats,
            planner,
            paper,
            scene,
        }
    }

    fn iterate(&mut self) {
        let (run, settings, config) = (self.planner.settings(), self.paper.settings(), self.planner.config());
        let own = config.of_paper().expect("the paper's objective");
        let (first, live) = (self.clock.first as usize, self.clock.live as usize);
        let pool = settings.pool as usize;
        let batch: Vec<usize> =
            (0..settings.probes).map(|i| (self.clock.iteration * settings.probes + i) as usize % pool).collect();
        let texels = self.directions.len();
        let probes: Vec<_> = batch
            .iter()
            .map(|&i| &self.paper.maps().probes[i])
            .map(|probe| (Vec3::from(probe.position).as_dvec3(), f64::from(probe.score)))
            .collect();
        let depth: Vec<f64> =
            batch.iter().flat_map(|&i| self.depth[i * texels..(i + 1) * texels].iter().copied()).collect();
        let camera = self.planner.start()[0];
        let tangents = [f64::from(camera.tan_x), f64::from(camera.tan_y)];
        let batch = Batch {
            settings,
            gate: config.gate,
            kernel: own.kernel,
            occlusion: own.occlusion,
            splats: &self.splats[..live],
            tangents: &[tangents],
            probes: &probes,
            directions: &self.directions,
            depth: &depth,
            log_scale: self.scale.log_scale,
        };
        let image = dense(&batch);
        let (reg, reg_centre, reg_direction) = regulariser(&batch, &image.weights);
        let lambda = f64::from(settings.lambda_reg);
        let by_direction: Vec<DVec3> = (0..live).map(|j| image.by_direction[j] + lambda * reg_direction[j]).collect();
        let mut bound = 0.0;
        let mut by_centre: Vec<DVec3> = (0..live).map(|j| image.by_centre[j] + lambda * reg_centre[j]).collect();
        for (by_centre, splat) in by_centre.iter_mut().zip(&self.splats).skip(first) {
            let (violation, outward) = self.scene.device.geometry.violation(splat.0);
            *by_centre += f64::from(run.lambda_bound) * outward;
            bound += violation;
        }
        self.terms = [image.loss, reg, bound];
        let most = |of: &[DVec3]| of.iter().map(|g| g.abs().max_element()).fold(0.0, f64::max);
        let (most_centre, most_direction) = (most(&by_centre), most(&by_direction));
        for j in first..live {
            let across = by_direction[j] - by_direction[j].dot(self.splats[j].1) * self.splats[j].1;
            self.noise[j] |= by_centre[j].abs().min_element() < 1e-4 * most_centre;
            self.noise[j] |= across.abs().min_element() < 1e-4 * most_direction;
            let gradient = (by_centre[j], by_direction[j]);
            self.splats[j] = update(run, &self.clock, self.splats[j], &mut self.moments[j], gradient);
        }
        self.scale = self.scale.next(settings, image.by_log_scale, &self.clock);
        self.clock = self.clock.next(run);
    }
}

/// A sign, a moment, a bias correction, a schedule or a probe of another batch wrong, and the run still goes somewhere, only
/// worse: no test of a single gradient shows it. Here the steps themselves are compared, and what they may differ by is a
/// hundredth of a step at the full rate: Adam divides a gradient by its own size, so that a relative error of a thousandth,
/// which a texel at a rim makes, becomes as much of a step, five times over.
#[test]
fn five_iterations_are_those_of_the_twin() {
    let context = context();
    let scene = thin_shell(&context, -0.3);
    let paper = Config::paper(Preset::Object, 12).with_paper(|own| {
        // Not a multiple of the batch, so that batches wrap around.
        (own.pool, own.pass, own.resolution, own.relocate_every) = (40, Pass::Dense, Some(24), 0);
    });
    let joint = Config {
        gate: Gate::Soft,
        gate_softness: 0.05,
        iterations: 6,
        probes: 12,
        checkpoint_every: 6,
        lr_position: 0.03,
        // The pull of the region is then about as large as the other gradients. At its default it is a spring so stiff that,
        // where a splat is just out, rounding of the position decides about the step.
        lambda_bound: 0.1,
        seed: 11,
        ..paper
    };
    let in_space = joint.clone().with_paper(|own| own.kernel = Kernel::Metric);
    let iterative = joint.clone().with_paper(|own| own.iterative = true);
    let cases = [
        ("splat", joint),
        ("in space", Config { gate: Gate::Pinhole, ..in_space }),
        // Two iterations per view: the third view has begun by the end.
        ("iterative", Config { iterations: 10, views: 3, ..iterative }),
    ];
    for (name, config) in cases {
        let views = config.views as usize;
        let planner = planner(&context, &scene, config.clone());
        let mut twin = Twin::new(&planner, &scene);
        let (mut moved, mut scales, mut terms) = (0.0f64, vec![twin.scale.log_scale], Vec::new());
        for count in 1..=5 {
            iterate(&context, &planner);
            // Once a splat goes its own way, so do the sums over splats.
            let in_step = !twin.noise.contains(&true);
            twin.iterate();
            terms.extend(in_step.then_some(twin.terms));
            scales.push(twin.scale.log_scale);
            assert_eq!(planner.done(), count);
            let splats = planner.splats().expect("splats");
            let rates = [config.lr_position, config.lr_direction].map(f64::from);
            for (j, (splat, &(centre, direction))) in splats.iter().zip(&twin.splats).enumerate() {
                let off = (Vec3::from(splat.centre).as_dvec3() - centre).length();
                let turned = (Vec3::from(splat.direction).as_dvec3() - direction).length();
                if !twin.noise[j] {
                    let case = format!("{name}, splat {j} after {count}");
                    assert!(off < 0.01 * rates[0] && turned < 0.01 * rates[1], "{case}: off {off}, turned {turned}");
                }
                moved = moved.max((Vec3::from(planner.start()[j].centre).as_dvec3() - centre).length() / rates[0]);
            }
        }
        let noise = twin.noise.iter().filter(|noise| **noise).count();
        assert!(4 * noise <= views, "{name}: the gradients of {noise} of {views} splats are noise");
        assert!(moved > 2.0, "{name}: the splats hardly moved, by {moved} steps");
        let pulled = terms.iter().any(|terms| terms[2] > 1e-6);
        assert!(pulled || name == "iterative", "{name}: no splat left the region, so that its pull is not tested");
        // A record holds the state before its iteration.
        let history = planner.outcome().expect("an outcome").history;
        assert_eq!(history.len(), 5);
        for (record, scale) in history.iter().zip(&scales) {
            let off = (f64::from(record.scale.expect("a scale")).ln() - scale).abs();
            assert!(
                off < 0.01 * f64::from(PaperConfig::default().lr_scale),
                "{name}: the scale is off by {off} of its logarithm"
            );
        }
        for (record, twin) in history.iter().zip(&terms) {
            for (device, twin) in [record.image, record.reg, record.bound].into_iter().zip(twin) {
                let off = (f64::from(device) - twin).abs();
                assert!(off <= 0.01 * twin.abs() + 1e-6, "{name}: {record:?} against {terms:?}");
            }
        }
        let steady = scales.iter().all(|scale| *scale == scales[0]);
        assert_eq!(steady, name == "iterative", "{name}: the scale moves where all splats do");
        assert!(twin.clock.live as usize == views && twin.clock.first == if name == "iterative" { 2 } else { 0 });
    }
    silent(&context);
}

/// The pull of the region must be that of the loss which is reported, and lead back in, also from where a splat has left
/// the shell, outward or inward, and sunk below the floor at once. Steps so wide above a floor so high lead there; at such a
/// weight, the gradient of the points is lost in the pull.
#[test]
fn the_pull_of_the_region_is_that_of_the_twin() {
    let context = context();
    let scene = thin_shell(&context, 1.1);
    let weight = 1e6f32;
    let config = Config {
        iterations: 6,
        probes: 8,
        lr_position: 0.2,
        decay: 1.0,
        lambda_bound: weight,
        ..Config::new(Preset::Object, 40)
    };
    let planner = planner(&context, &scene, config);
    let geometry = &scene.device.geometry;
    let Some(floor) = geometry.region.floor else { unreachable!("it was given") };
    let (mut corners, mut sums) = (0, Vec::new());
    for _ in 0..5 {
        let before: Vec<DVec3> =
            planner.splats().expect("splats").iter().map(|splat| Vec3::from(splat.centre).as_dvec3()).collect();
        iterate(&context, &planner);
        let twin: Vec<_> = before.iter().map(|centre| geometry.violation(*centre)).collect();
        sums.push(twin.iter().map(|(value, _)| value).sum::<f64>());
        // In the planner's frame the shell reaches from 0.93 to 1.
        let corner = |p: &&DVec3| p.z < floor - 0.02 && !(0.91..1.02).contains(&p.length());
        corners += before.iter().filter(corner).count();
        for ((gradient, (_, pull)), at) in planner.gradients().expect("gradients").iter().zip(&twin).zip(&before) {
            let device = Vec3::from(gradient.centre).as_dvec3() / f64::from(weight);
            assert!((device - *pull).length() < 1e-3 * pull.length() + 1e-5, "{device} against {pull} at {at}");
        }
    }
    assert!(corners > 0, "no splat left the shell and sank below the floor at once");
    for (record, twin) in planner.outcome().expect("an outcome").history.iter().zip(sums) {
        assert!((f64::from(record.bound) - twin).abs() < 1e-4 * twin + 1e-6, "{record:?} against {twin}");
    }
    silent(&context);
}
