//! Whether the photos of a capture are enough: what more of them would gain, and where they are weak.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use super::config::Config;
use super::pipeline::expected_beside;
use super::preparation::Preparation;
use super::problem::Problem;
use super::reference::Reference;
use super::target::Target;
use crate::engine::parallel::mapped;
use crate::engine::vulkan::Context;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::proxy::SurfacePoint;
use crate::scene::surface::digits;
use crate::{Error, Result};

/// Further photos of which the gain says whether those that there are are enough.
pub const MORE: u32 = 10;
/// Gain of that many, in decibels, below which photos are enough, and above which they are not: where the law expected about the first, trained
/// splats gained 0.1 dB of two objects, by an earlier law that expected less (docs/results/watch.md).
const LITTLE: f64 = 0.25;
const MUCH: f64 = 1.0;
/// Share of what viewers look at that no photo shows, above which photos are not enough whatever ten more gain.
const HIDDEN: f64 = 0.25;
/// Error over the median, in decibels, from which a part of the surface is weak; its radius as a part of the surface's; its share of
/// the points at least; how many are named.
const WEAK_DB: f32 = 3.0;
const RADIUS: f64 = 0.2;
const SHARE: f64 = 0.01;
const PARTS: usize = 3;

/// What is said of the photos of a capture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Enough {
    /// Further photos that were planned.
    pub more: u32,
    /// Decibels that these, the best there are, are expected to gain.
    pub gain_db: f64,
    /// Standard deviation of that figure, as [`crate::planner::quality::law::Fitted::spread`] has it.
    pub gain_sd_db: f64,
    /// Share of what viewers look at that no photo sees.
    pub unseen: f64,
    /// Decibels that these are expected to be ahead of the photos of the capture, where they are others; negative where behind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub over_own_db: Option<f64>,
    /// Parts of the surface with much error, the largest first.
    pub weak: Vec<Weak>,
}

/// A part of the surface with much error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Weak {
    /// Its middle.
    pub place: DVec3,
    /// Its share of the surface's points.
    pub share: f64,
    /// Decibels of error over the median of the surface.
    pub db: f64,
    /// The photo that has it nearest to its middle, and where in it; none where it is in none.
    pub photo: Option<(String, String)>,
}

/// What is said of the photos of a capture, and what to do about it.
pub struct Advice {
    /// In numbers.
    pub enough: Enough,
    /// Where further photos help most, all of them together, in the user's world; in no order before [`Self::nearest_first`].
    pub further: Vec<Camera>,
    /// Points of the surface, in the user's world, and what is expected there of the photos: decibels of error over the median.
    pub points: Vec<DVec3>,
    /// See `points`.
    pub errors: Vec<f32>,
    /// By point, whether no photo shows it.
    pub unseen: Vec<bool>,
}

impl Advice {
    /// Of the photos `cameras`, beside which further ones have this lens, by the viewers, seed and held-out points of `config`, which has the
    /// number of further photos too (`views`); beside `own`, the photos of the capture, where these are others. `go_on` is asked every now
    /// and then and may stop it.
    ///
    /// # Errors
    /// As a plan, and [`Error::Interrupted`] where it was stopped.
    pub fn new(
        context: &Arc<Context>,
        target: &Target,
        lens: Intrinsics,
        cameras: &[Camera],
        own: Option<&[Camera]>,
        config: &Config,
        go_on: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Self> {
        if cameras.is_empty() {
            return Err(Error::request("there are no photos to judge"));
        }
        let problem = Problem::new(target, lens, cameras)?;
        let scene = Arc::new(problem.on(context)?);
        // The first, since it refuses more photos than fit the device.
        let preparation = Preparation::new(context, &problem, config.clone())?;
        let reference = Reference::observed(context, &problem, &scene, config, go_on)?;
        let before = reference.expect(&[])?;
        let own = own.map(|own| reference.expect_cameras(own)).transpose()?;
        let over_own_db = own.map(|own| own.error_db - before.error_db);
        let (after, poses) = expected_beside(context, &scene, &reference, preparation, go_on)?;
        let held_out = problem.held_out(config)?;
        let points: Vec<DVec3> = held_out.iter().map(|point| point.position).collect();
        let errors = reference.prediction(cameras, &points)?.map.points;
        let radius = RADIUS * target.proxy.sphere.1;
        let gain_db = before.error_db - after.error_db;
        let enough = Enough {
            more: config.views,
            gain_db,
            gain_sd_db: config.law().spread(gain_db),
            unseen: before.unseen,
            over_own_db,
            weak: weak(&points, &errors, radius, cameras),
        };
        let mut further = problem.cameras(&poses);
        further.truncate(poses.len());
        let hidden = |point: &SurfacePoint| {
            let at = point.position + point.lift * point.normal;
            !cameras.iter().any(|camera| problem.geometry.sees(camera, at))
        };
        let unseen = mapped(&held_out, |_, point| hidden(point));
        Ok(Self { enough, further, points, errors, unseen })
    }

    /// Sorts the further photos by how far they are from a place, in the user's world.
    pub fn nearest_first(&mut self, place: DVec3) {
        let away = |camera: &Camera| camera.pose.position.distance(place);
        self.further.sort_by(|a, b| away(a).total_cmp(&away(b)));
    }
}

impl Enough {
    /// Whether the photos are enough: "yes", "nearly" or "not yet", where [`MORE`] further ones were planned.
    pub fn answer(&self) -> &'static str {
        match self.gain_db {
            // Ten more gain little, too, where they can hardly begin to show what is missing.
            _ if self.unseen > HIDDEN => "not yet",
            gain if gain < LITTLE => "yes",
            gain if gain < MUCH => "nearly",
            _ => "not yet",
        }
    }

    /// The answer with its reason, in words.
    pub fn line(&self) -> String {
        let answer = self.answer();
        let gain = match self.gain_db {
            gain if gain < LITTLE => {
                format!("{} more photos, wherever they are taken, would gain under {LITTLE} dB", self.more)
            }
            gain => format!("the {} photos that help most would gain about {gain:.1} dB", self.more),
        };
        format!("{answer}: {gain}; no photo shows {:.1}% of what viewers look at", 100.0 * self.unseen)
    }
}

impl Weak {
    /// In words, on one line.
    pub fn line(&self) -> String {
        let place = match &self.photo {
            Some((photo, part)) => format!("what {photo} shows {part}"),
            None => {
                let digits = digits(self.place.abs().max_element());
                format!("around {:.digits$}, which is in no photo", self.place)
            }
        };
        format!(
            "{place}: {:.0}% of the surface, {:.1} dB more error than its middling part",
            100.0 * self.share,
            self.db
        )
    }
}

/// The parts around the points with most error, no two of which overlap.
fn weak(points: &[DVec3], errors: &[f32], radius: f64, cameras: &[Camera]) -> Vec<Weak> {
    let mut left: Vec<(DVec3, f32)> =
        points.iter().copied().zip(errors.iter().copied()).filter(|(_, error)| *error >= WEAK_DB).collect();
    let mut parts = Vec::new();
    while let Some((seed, _)) = left.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)) {
        let (part, rest): (Vec<_>, Vec<_>) = left.iter().copied().partition(|(p, _)| p.distance(seed) <= radius);
        left = rest;
        let count = part.len() as f64;
        let place = part.iter().map(|(p, _)| *p).sum::<DVec3>() / count;
        let db = part.iter().map(|(_, error)| f64::from(*error)).sum::<f64>() / count;
        parts.push(Weak { place, share: count / points.len() as f64, db, photo: shown(place, cameras) });
    }
    parts.retain(|part| part.share >= SHARE);
    parts.sort_by(|a, b| (b.share * b.db).total_cmp(&(a.share * a.db)));
    parts.truncate(PARTS);
    parts
}

/// The camera that has a place nearest to the middle of its picture, and where in it; occlusion does not count.
fn shown(place: DVec3, cameras: &[Camera]) -> Option<(String, String)> {
    let at = |camera: &Camera| {
        let local = camera.pose.rotation.inverse() * (place - camera.pose.position);
        let lens = &camera.intrinsics;
        let [x, y] = [0, 1].map(|k| {
            (lens.focal[k] * local[k] / local.z + lens.principal[k]) / f64::from([lens.width, lens.height][k])
        });
        camera.sees(place).then_some([x, y])
    };
    let off = |[x, y]: [f64; 2]| (x - 0.5).hypot(y - 0.5);
    let seen = cameras.iter().filter_map(|camera| at(camera).map(|at| (camera, at)));
    let (camera, [x, y]) = seen.min_by(|a, b| off(a.1).total_cmp(&off(b.1)))?;
    let third = |share: f64, words: [&'static str; 3]| words[((3.0 * share) as usize).min(2)];
    let part = match (third(y, ["at the top", "", "at the bottom"]), third(x, ["left", "", "right"])) {
        ("", "") => "in the middle".into(),
        ("", side) => format!("on the {side}"),
        (end, "") => end.to_owned(),
        (end, side) => format!("{end} {side}"),
    };
    Some((camera.name.clone(), part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::camera::Pose;

    /// If this failed, a photographer would be sent to the wrong place, or be told of single points.
    #[test]
    fn weak_parts_are_named_by_the_photos_that_show_them() {
        let camera = |name: &str, x: f64| Camera {
            name: name.into(),
            pose: Pose::looking(DVec3::new(x, -5.0, 0.0), DVec3::Y, DVec3::Z),
            intrinsics: Intrinsics::from_fov(300, 300, 1.0),
        };
        let cameras = [camera("a.jpg", 0.0), camera("b.jpg", 6.0)];
        // A plane of points, weak around (4, 0, 2), and a lone wrong point.
        let points: Vec<DVec3> =
            (0..2500).map(|i| DVec3::new(f64::from(i % 50) * 0.2 - 3.0, 0.0, f64::from(i / 50) * 0.1 - 2.5)).collect();
        let spot = DVec3::new(4.0, 0.0, 2.0);
        let error = |i: usize| {
            if i == 7 {
                20.0
            } else if points[i].distance(spot) < 0.6 {
                6.0
            } else {
                0.0
            }
        };
        let errors: Vec<f32> = (0..points.len()).map(error).collect();
        let found = weak(&points, &errors, 1.0, &cameras);
        let [part] = &found[..] else { panic!("{found:?}") };
        assert!(part.place.distance(spot) < 0.2 && (part.db - 6.0).abs() < 1e-6, "{part:?}");
        assert_eq!(part.photo, Some(("b.jpg".into(), "at the top left".into())));
        assert!(part.line().starts_with("what b.jpg shows at the top left"), "{}", part.line());
        let unseen = weak(&points, &errors, 1.0, &[camera("c.jpg", -60.0)]);
        assert!(unseen[0].photo.is_none() && unseen[0].line().contains("in no photo"));
    }

    /// If this failed, a capture that ten photos would help much would be called good enough.
    #[test]
    fn the_answer_follows_the_gain() {
        let of = |gain_db: f64, unseen: f64| {
            let (more, gain_sd_db, weak) = (MORE, 0.4, Vec::new());
            Enough { more, gain_db, gain_sd_db, unseen, over_own_db: None, weak }.line()
        };
        let line = |gain_db: f64| of(gain_db, 0.021);
        assert!(of(0.1, 0.9).starts_with("not yet"));
        assert!(line(0.1).starts_with("yes: 10 more photos, wherever") && line(0.1).contains("2.1%"));
        assert!(line(0.6).starts_with("nearly: the 10 photos that help most would gain about 0.6 dB"));
        assert!(line(2.4).starts_with("not yet"));
    }
}
