//! Cameras on a sphere, one after another to where pictures differ most under a model's noise: view planning by manifold sampling
//! (Lyu et al. 2024). The noise is [`crate::splats::uncertainty::manifold`]'s.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::engine::vulkan::Context;
use crate::engine::vulkan::shaders::glsl::shared::adam;
use crate::planner::plan::problem::Problem;
use crate::planner::select::information::Model;
use crate::scene::camera::{Camera, Intrinsics, Pose};
use crate::scene::layouts;
use crate::scene::random;
use crate::scene::region::{Region, Shape};
use crate::splats::render::frame::{Frame, View};
use crate::splats::render::rasterizer::Size;
use crate::splats::uncertainty::manifold::{MAX_PICTURES, MAX_VIEWS, Manifold};
use crate::{Error, Result};

/// Stream of the directions that ascents start from.
const STARTS: u32 = 0x4d53_0001;
/// Half the difference of angles that slopes are taken over, in radians: so much that what jumps (parts cut off at 1/255,
/// Gaussians that change places) is small beside it.
const DIFFERENCE: f64 = 0.01;
/// How near to a pole cameras come, in radians: beyond it they would turn about themselves.
const POLE: f64 = 0.02;
/// Pictures by which starts are compared, at least.
const COMPARED: u32 = 8;
/// Cameras that the frame of training is taken from.
const FRAME: usize = 16;

/// What can be chosen about manifold sampling.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ManifoldSettings {
    /// Views on Fibonacci points of the sphere to begin with, where there are none.
    pub first: u32,
    /// Steps of learning the noise before the first camera is placed.
    pub learn: u32,
    /// Steps after each camera, every other one from that camera.
    pub relearn: u32,
    /// What the noise of a Gaussian on average, summed over its parameters, is worth beside the mean square difference of a
    /// picture in [0, 1]. With 0.001, colours that one view shows take noise of about a tenth.
    pub reward: f32,
    /// Perturbed pictures of a view in a step of the ascent.
    pub renders: u32,
    /// Directions that are compared, of which the best begins the ascent.
    pub starts: u32,
    /// Steps of the ascent.
    pub steps: u32,
    /// Adam's rate, in radians.
    pub rate: f64,
    /// Longer side of the pictures in pixels at most.
    pub side: u32,
}

impl Default for ManifoldSettings {
    fn default() -> Self {
        Self {
            first: 4,
            learn: 200,
            relearn: 20,
            reward: 1e-3,
            renders: 2,
            starts: 8,
            steps: 401,
            rate: 5e-4,
            side: 128,
        }
    }
}

impl ManifoldSettings {
    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// In a line that names the setting.
    pub fn validate(&self) -> Result<()> {
        let limits = [
            ("first", self.first, 1, 1000),
            ("renders", self.renders, 2, MAX_PICTURES),
            ("starts", self.starts, 1, 1000),
            ("side", self.side, 8, 4096),
        ];
        match limits.into_iter().find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => {
                Err(Error::request(format!("manifold: {name} is {value}; give {low} to {high}")))
            }
            None => Ok(()),
        }
    }
}

/// The sphere of the cameras, which look at its centre.
struct Sphere {
    centre: DVec3,
    radius: f64,
    up: DVec3,
    /// Two axes across `up`.
    across: [DVec3; 2],
    /// Least elevation.
    lowest: f64,
}

/// Azimuth and elevation, in radians.
type Angles = [f64; 2];

impl Sphere {
    /// Halfway through a shell, above its floor.
    fn new(region: &Region) -> Result<Self> {
        let Shape::Shell { centre, r_min, r_max } = region.shape else {
            let what = "places cameras on a sphere about an object, and there is none in a room; use another method";
            return Err(Error::request(format!("`method` manifold {what}")));
        };
        let radius = 0.5 * (r_min + r_max);
        let least = region.floor.map_or(-1.0, |floor| ((floor - centre.dot(region.up)) / radius).clamp(-1.0, 1.0));
        let (x, y) = region.up.any_orthonormal_pair();
        let lowest = least.asin().clamp(POLE - FRAC_PI_2, FRAC_PI_2 - POLE);
        Ok(Self { centre, radius, up: region.up, across: [x, y], lowest })
    }

    fn pose(&self, [azimuth, elevation]: Angles) -> Pose {
        let [x, y] = self.across;
        let flat = elevation.cos() * (azimuth.cos() * x + azimuth.sin() * y);
        let outward = flat + elevation.sin() * self.up;
        Pose::looking(self.centre + self.radius * outward, -outward, self.up)
    }

    /// A direction, even over the part of the sphere above the floor.
    fn draw(&self, seed: u64, index: u32) -> Angles {
        let [u, v, ..] = random::uniforms(seed, STARTS, index);
        let height = self.lowest.sin() + (1.0 - self.lowest.sin()) * u;
        self.within([TAU * v, height.asin()])
    }

    fn within(&self, [azimuth, elevation]: Angles) -> Angles {
        [azimuth, elevation.clamp(self.lowest, FRAC_PI_2 - POLE)]
    }
}

/// A sphere, and the model that is looked at from there.
struct Scene {
    sphere: Sphere,
    frame: Frame,
    intrinsics: Intrinsics,
    manifold: Manifold,
    /// Perturbations taken so far.
    draws: u32,
}

impl Scene {
    fn view(&self, pose: Pose) -> View {
        self.frame.view(&Camera { name: String::new(), pose, intrinsics: self.intrinsics })
    }

    /// How much pictures from these directions differ, under the same perturbations.
    fn spread(&mut self, angles: &[Angles], pictures: u32) -> Result<Vec<f64>> {
        let views: Vec<View> = angles.iter().map(|angles| self.view(self.sphere.pose(*angles))).collect();
        let draws = self.draws..self.draws.wrapping_add(pictures);
        let mut spreads = Vec::new();
        for views in views.chunks(MAX_VIEWS) {
            spreads.extend(self.manifold.spread(views, draws.clone())?);
        }
        self.draws = draws.end;
        Ok(spreads)
    }

    /// The slope of the spread by each angle, by central differences under the same perturbations.
    fn slope(&mut self, [azimuth, elevation]: Angles, pictures: u32) -> Result<Angles> {
        let step = DIFFERENCE;
        let around = [
            [azimuth + step, elevation],
            [azimuth - step, elevation],
            [azimuth, elevation + step],
            [azimuth, elevation - step],
        ];
        let spreads = self.spread(&around, pictures)?;
        Ok([0, 2].map(|k| (spreads[k] - spreads[k + 1]) / (2.0 * step)))
    }

    /// The best of random directions, and from there uphill.
    fn climb(&mut self, settings: &ManifoldSettings, seed: u64, camera: u32) -> Result<Angles> {
        let ManifoldSettings { starts, steps, rate, renders, .. } = *settings;
        let drawn: Vec<Angles> = (0..starts).map(|i| self.sphere.draw(seed, camera * starts + i)).collect();
        let mut best: Option<(Angles, f64)> = None;
        for (angles, spread) in drawn.iter().zip(self.spread(&drawn, renders.max(COMPARED))?) {
            if best.is_none_or(|(_, most)| spread > most) {
                best = Some((*angles, spread));
            }
        }
        let Some((mut angles, _)) = best.filter(|(_, most)| *most > 0.0) else {
            let what = "no picture of it differs under its noise; is the model in the scene's frame?";
            return Err(Error::request(format!("`method` manifold: {what}")));
        };
        let mut moments = [[0.0; 2]; 2];
        for step in 1..=steps as i32 {
            let slope = self.slope(angles, renders)?;
            for k in 0..2 {
                angles[k] += ascent(slope[k], &mut moments[k], rate, step);
            }
            angles = self.sphere.within(angles);
        }
        Ok(angles)
    }

    /// Learns the noise of the model from known views in turn; where there is a `newest`, every other time from that.
    fn learn(&mut self, known: &[View], newest: Option<&View>, steps: u32) -> Result<()> {
        let all = known.len() as u32 + u32::from(newest.is_some());
        for step in 0..steps {
            let turn = |step: u32| known.get(step as usize % known.len().max(1));
            let view = match newest {
                Some(newest) if step % 2 == 0 => Some(newest),
                Some(_) => turn(all + step / 2),
                None => turn(step),
            };
            if let Some(view) = view {
                self.manifold.learn(view, all)?;
            }
        }
        Ok(())
    }
}

/// Poses of `views` cameras on the sphere halfway through a shell, after those of `kept`, in the model's world. The noise of the model
/// is learnt from the views so far, without which a few on Fibonacci points come first; then every camera goes where the
/// spread is largest and counts as one more of these views. Views that are kept have the new cameras' lens here. Before each
/// camera `go_on` decides whether to continue.
///
/// # Errors
/// A region that is no shell, a model that the sphere does not show, or a device that fails or has not enough memory.
pub fn place(
    context: &Arc<Context>,
    problem: &Problem<'_>,
    model: &Model,
    (settings, seed): (ManifoldSettings, u64),
    views: usize,
    go_on: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Vec<Pose>> {
    settings.validate()?;
    let (region, kept, intrinsics) = (&problem.target.region, problem.kept, problem.lens);
    let sphere = Sphere::new(region)?;
    let intrinsics = intrinsics.shrunk(intrinsics.width.max(intrinsics.height).div_ceil(settings.side));
    let around = layouts::fibonacci_shell(region, FRAME)?;
    let cameras: Vec<Camera> =
        around.into_iter().map(|pose| Camera { name: String::new(), pose, intrinsics }).collect();
    let frame = Frame::new(&cameras, &model.gaussians.centres);
    let gaussians = frame.gaussians_to_training(model.gaussians.clone());
    let size = Size { width: intrinsics.width, height: intrinsics.height };
    let manifold = Manifold::new(context, &gaussians, size, model.antialiased, (seed, settings.reward))?;
    let mut scene = Scene { sphere, frame, intrinsics, manifold, draws: 0 };

    let mut placed = match kept {
        [] => layouts::fibonacci_shell(region, views.min(settings.first as usize))?,
        _ => Vec::new(),
    };
    let poses = kept.iter().map(|camera| camera.pose).chain(placed.iter().copied());
    let mut known: Vec<View> = poses.map(|pose| scene.view(pose)).collect();
    if placed.len() < views {
        scene.learn(&known, None, settings.learn)?;
    }
    while placed.len() < views {
        Error::unless_stopped(go_on())?;
        let angles = scene.climb(&settings, seed, placed.len() as u32)?;
        let pose = scene.sphere.pose(angles);
        let view = scene.view(pose);
        placed.push(pose);
        if placed.len() < views {
            scene.learn(&known, Some(&view), settings.relearn)?;
        }
        known.push(view);
    }
    Ok(placed)
}

/// Adam's step uphill, number `step` from 1 (Kingma and Ba 2015); `moments` are zero at the start.
fn ascent(slope: f64, moments: &mut [f64; 2], rate: f64, step: i32) -> f64 {
    let decays = [adam::ADAM_DECAY, adam::ADAM_SQUARE_DECAY];
    let [mean, square] = std::array::from_fn(|k| {
        moments[k] = decays[k] * moments[k] + (1.0 - decays[k]) * [slope, slope * slope][k];
        moments[k] / (1.0 - decays[k].powi(step))
    });
    rate * mean / (square.sqrt() + f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::engine::vulkan::ContextOptions;
    use crate::scene::gaussians::Gaussians;
    use crate::splats::render::layout::{self, HARMONICS};
    use crate::splats::twin;
    use crate::splats::uncertainty::manifold::perturbation;

    fn region(floor: Option<f64>) -> Region {
        let shape = Shape::Shell { centre: DVec3::new(0.1, 0.0, -0.2), r_min: 2.5, r_max: 3.5 };
        Region { shape, up: DVec3::Z, floor, clearance: 0.0 }.validated().unwrap()
    }

    /// A ball of opaque Gaussians.
    fn ball(count: u32, log_scale: f32) -> Gaussians {
        let mut gaussians = Gaussians { degree: 0, ..Gaussians::default() };
        for i in 0..count {
            let [u, v, w, x] = random::uniforms(8, 0, i);
            gaussians.centres.push(0.9 * random::direction(u, v));
            gaussians.log_scales.push([log_scale; 3]);
            gaussians.rotations.push([1.0, 0.0, 0.0, 0.0]);
            gaussians.opacities.push(3.0);
            gaussians.harmonics.extend([w, x, u].map(|colour| (2.0 * colour - 1.0) as f32));
        }
        gaussians
    }

    /// A model seen from the middle of a shell, with noise of `scale` in the colours of the Gaussians that `noisy` selects; and
    /// that noise.
    fn scene(
        context: &Arc<Context>,
        gaussians: &Gaussians,
        (side, scale): (u32, f32),
        noisy: impl Fn(DVec3) -> bool,
    ) -> (Scene, Vec<f32>) {
        let frame = Frame { to_training: crate::scene::similarity::Similarity::IDENTITY };
        let size = Size { width: side, height: side };
        let mut manifold = Manifold::new(context, gaussians, size, false, (7, 1.0)).unwrap();
        let mut scales = vec![0f32; layout::planes(0) * gaussians.len()];
        for (i, _) in gaussians.centres.iter().enumerate().filter(|(_, centre)| noisy(**centre)) {
            (0..3).for_each(|c| scales[(HARMONICS + c) * gaussians.len() + i] = scale);
        }
        manifold.set_scales(&scales).unwrap();
        let intrinsics = Intrinsics::from_fov(side, side, 0.8);
        let sphere = Sphere::new(&region(None)).unwrap();
        (Scene { sphere, frame, intrinsics, manifold, draws: 0 }, scales)
    }

    /// If this failed, cameras would leave their sphere, look past the object or go below the floor.
    #[test]
    fn angles_are_places_on_the_sphere_above_the_floor() {
        let sphere = Sphere::new(&region(Some(0.5))).unwrap();
        for i in 0..200 {
            let pose = sphere.pose(sphere.draw(3, i));
            let away = pose.position - sphere.centre;
            assert!((away.length() - 3.0).abs() < 1e-9 && pose.position.z > 0.5 - 1e-9, "{}", pose.position);
            assert!(pose.forward().dot(-away.normalize()) > 1.0 - 1e-9);
        }
        let low = sphere.pose(sphere.within([1.0, -2.0])).position;
        assert!((low.z - 0.5).abs() < 1e-9, "{low}");
        let room = Shape::Box { min: DVec3::NEG_ONE, max: DVec3::ONE };
        let room = Region { shape: room, ..region(None) };
        assert!(Sphere::new(&room).is_err_and(|error| error.to_string().contains("none in a room")));
    }

    /// Against differences ten times as fine of the twin without cut-offs, in double precision, under the same perturbations: with
    /// cut-offs, what jumps at them is more than so fine a difference. If this failed, cameras would not go uphill.
    #[test]
    fn slopes_are_those_of_the_spread() {
        let context = Context::new(&ContextOptions { validation: true, ..ContextOptions::default() }).unwrap();
        let gaussians = ball(25, -2.3);
        let (mut scene, scales) = scene(&context, &gaussians, (48, 0.4), |centre| centre.x > 0.0);
        let base = layout::to_planes(&gaussians, 0, gaussians.len());
        let spread = |scene: &Scene, angles: Angles| {
            let view = scene.view(scene.sphere.pose(angles));
            let rows = [view.row_x, view.row_y, view.row_z].map(|row| row.map(f64::from));
            let axes = rows.map(|[x, y, z, _]| DVec3::new(x, y, z));
            let view = twin::View {
                rotation: glam::DMat3::from_cols(axes[0], axes[1], axes[2]).transpose(),
                translation: DVec3::new(rows[0][3], rows[1][3], rows[2][3]),
                focal: view.focal.map(f64::from),
                principal: view.principal.map(f64::from),
                width: view.width,
                height: view.height,
                near: f64::from(view.near),
            };
            let pictures: Vec<Vec<DVec3>> = (0..2)
                .map(|draw| {
                    let moved = |(i, value): (usize, &f32)| value + scales[i] * perturbation(7, i as u32, draw);
                    let values: Vec<f32> = base.iter().enumerate().map(moved).collect();
                    let splats = layout::from_planes(&values, 0, gaussians.len(), gaussians.len());
                    twin::render(&twin::splats(&splats), &view, &twin::Rules::smooth(), DVec3::ZERO).colour
                })
                .collect();
            let squares = pictures[0].iter().zip(&pictures[1]).map(|(a, b)| 0.5 * (*a - *b).length_squared());
            squares.sum::<f64>() / (48.0 * 48.0)
        };
        for angles in [[1.2, 0.3], [-1.4, -0.5], [2.0, 0.9]] {
            scene.draws = 0;
            let slope = scene.slope(angles, 2).unwrap();
            let fine = |k: usize| {
                let [more, less] = [0.1, -0.1].map(|part| {
                    let mut angles = angles;
                    angles[k] += part * DIFFERENCE;
                    spread(&scene, angles)
                });
                (more - less) / (0.2 * DIFFERENCE)
            };
            let expected = [fine(0), fine(1)];
            let apart = (slope[0] - expected[0]).hypot(slope[1] - expected[1]);
            assert!(apart < 0.1 * expected[0].hypot(expected[1]), "{slope:?} and {expected:?} at {angles:?}");
        }
        assert_eq!(context.messages(), [""; 0]);
    }

    /// If this failed, cameras would not go where the model is least certain.
    #[test]
    fn a_camera_goes_to_the_side_that_has_noise() {
        let context = Context::new(&ContextOptions { validation: true, ..ContextOptions::default() }).unwrap();
        let settings = ManifoldSettings { steps: 60, rate: 0.03, ..ManifoldSettings::default() };
        let gaussians = ball(150, -1.9);
        for towards in [DVec3::X, DVec3::new(-0.6, 0.0, 0.8)] {
            let (mut scene, _) = scene(&context, &gaussians, (32, 0.3), |centre| centre.dot(towards) > 0.4);
            let angles = scene.climb(&settings, 1, 0).unwrap();
            let away = (scene.sphere.pose(angles).position - scene.sphere.centre).normalize();
            assert!(away.dot(towards) > 0.9, "{away} is not towards {towards}");
        }
        let (mut scene, _) = scene(&context, &gaussians, (32, 0.3), |_| false);
        assert!(scene.climb(&settings, 1, 0).is_err());
        assert_eq!(context.messages(), [""; 0]);
    }
}
