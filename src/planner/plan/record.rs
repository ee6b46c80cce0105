//! What a plan leaves behind: the contents of `plan.json`, from which the report is drawn as well.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::planner::metrics::Metrics;
use crate::planner::quality::expected::decibels;
use crate::scene::camera::Camera;
use crate::scene::limits::Limits;
use crate::scene::region::Region;
use crate::scene::surface::digits;
use crate::scene::volume::Volume;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// All iterations ran.
    Complete,
    /// The user stopped the run; the plan is that of the last finished iteration.
    Interrupted,
}

/// The surface that was planned for.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SurfaceRecord {
    /// Path as the user gave it.
    pub path: String,
    /// "mesh", "points", ...
    pub kind: String,
    /// Triangles or discs that block rays.
    pub primitives: usize,
    /// Discs beside them that stand for surroundings that no point shows; none in files that do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assumed: Option<usize>,
    /// What of it is to be seen; all of it where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subject: Option<Volume>,
    /// Lowest corner of the bounds.
    pub min: DVec3,
    /// Highest corner of the bounds.
    pub max: DVec3,
}

/// One iteration of the optimiser.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IterationRecord {
    /// Iteration, from 0.
    pub iteration: u32,
    /// Weighted sum of all terms.
    pub loss: f32,
    /// Image term, or expected quality.
    pub image: f32,
    /// Coverage regulariser, unweighted.
    pub reg: f32,
    /// Region term, unweighted.
    pub bound: f32,
    /// Scale of the splats, of the paper's objective.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f32>,
}

/// Held-out metrics at an iteration.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CheckpointRecord {
    /// Iterations done.
    pub iteration: u32,
    /// Metrics over the held-out points.
    pub metrics: Metrics,
    /// Mean Voronoi cell area (steradians) over the third of seen points with the lowest score; absent where all
    /// scores are equal.
    pub voronoi_low_vds: Option<f64>,
    /// The same over the third with the highest score.
    pub voronoi_high_vds: Option<f64>,
}

/// Expected quality of a set of cameras, against the best simple layout of as many.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    /// Decibels of PSNR of trained splats, the mean over viewers; positive is better than the layout it is measured against.
    pub db: f64,
    /// Standard deviation of that figure, as [`crate::planner::quality::law::Fitted::spread`] has it.
    pub sd: f64,
    /// Share of what viewers look at that no camera sees.
    pub unseen: f64,
    /// The layout it is measured against.
    pub against: String,
    /// Why a plan gains nothing, where it is that layout itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl Expected {
    /// In words, on one line.
    pub fn line(&self) -> String {
        format!(
            "{} (sd {:.2}) against {} with as many views; no camera sees {:.1}% of what viewers look at",
            decibels(self.db, 2),
            self.sd,
            self.against,
            100.0 * self.unseen
        )
    }
}

/// How far the cameras connect, so that structure from motion can join their photos.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Connection {
    /// Widest angle between neighbours at a point of the surface, in degrees.
    pub degrees: f32,
    /// Sizes of the groups of cameras that neighbours join, the largest first; kept cameras count as joined.
    pub groups: Vec<usize>,
    /// How many of them are kept.
    pub kept: usize,
}

impl Connection {
    /// Whether all cameras hang together.
    pub fn is_whole(&self) -> bool {
        self.groups.len() == 1
    }

    /// In words, on one line.
    pub fn line(&self) -> String {
        let (degrees, kept, all) = (self.degrees, self.kept, self.groups.iter().sum::<usize>());
        let planned = match kept {
            0 => format!("{all} cameras"),
            _ => format!("{} planned cameras and the {kept} kept, which count as joined", all - kept),
        };
        match self.is_whole() {
            true => format!("{planned}: all hang together, neighbours at most {degrees}° apart at what both see"),
            false => format!(
                "{planned}: in {} groups, the largest of {}, not one within {degrees}°; plan more views, or allow a wider angle",
                self.groups.len(),
                self.groups.first().unwrap_or(&0),
            ),
        }
    }
}

/// The way along the planned cameras in their order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TourRecord {
    /// Length of the way.
    pub length: f64,
    /// Corners of the way: every planned camera, and what lies between where there is something to go around.
    pub path: Vec<DVec3>,
    /// Legs for which no way was found that keeps the clearance; they are straight.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub blocked: usize,
}

impl TourRecord {
    /// In words, on one line.
    pub fn line(&self) -> String {
        format!("{:.*} long from the first camera to the last", digits(self.length), self.length)
    }
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

/// A baseline: another way to place the same number of cameras, scored on the same points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BaselineRecord {
    /// "random", "fibonacci", ...
    pub name: String,
    /// Its metrics.
    pub metrics: Metrics,
}

/// Everything about a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanRecord {
    /// Version of camsplat that made the plan.
    pub version: String,
    /// How the run ended.
    pub status: Status,
    /// How the cameras were placed: "ours", or the name of the baseline or of the way to choose.
    #[serde(default)]
    pub method: String,
    /// The surface.
    pub surface: SurfaceRecord,
    /// Device name and driver.
    pub device: String,
    /// Seed of every random number.
    pub seed: u64,
    /// The configuration of the planner or the baseline, as it ran.
    pub config: serde_json::Value,
    /// The region of the cameras.
    pub region: Region,
    /// Further limits on camera positions.
    #[serde(default, skip_serializing_if = "Limits::is_empty")]
    pub limits: Limits,
    /// The planned cameras, then the kept ones.
    pub cameras: Vec<Camera>,
    /// How many of `cameras`, at the end of the list, were kept from before.
    pub kept: usize,
    /// Loss by iteration.
    pub history: Vec<IterationRecord>,
    /// Held-out metrics by iteration.
    pub checkpoints: Vec<CheckpointRecord>,
    /// Held-out metrics of the plan.
    pub metrics: Metrics,
    /// Expected quality of all cameras, where it was computed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<Expected>,
    /// The layout that the plan began from, and where the plan is that layout itself, since nothing better was found.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub began_from: Option<String>,
    /// How far the cameras connect, where they were to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub connection: Option<Connection>,
    /// The way from the first planned camera to the last, where they are in the order of a tour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tour: Option<TourRecord>,
    /// Lowest and highest corner of what may be the room of a box, where the cameras stand outside of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub elsewhere: Option<[DVec3; 2]>,
    /// Baselines on the same points.
    #[serde(alias = "controls")]
    pub baselines: Vec<BaselineRecord>,
    /// Wall time of the optimisation or the choice, seconds.
    pub seconds: f64,
}

/// Share of what viewers look at above which cameras that miss it are a doubt about a plan.
const BLIND: f64 = 0.25;

/// Share of the surface that can be seen below which it is said, where cameras are held to a space. Of points that photos saw up to a
/// tenth is hidden by the discs that stand for others.
const IN_SIGHT: f64 = 0.85;

impl PlanRecord {
    /// How much of the surface is seen from nowhere in the space that cameras are held to, on one line.
    pub fn out_of_sight(&self) -> Option<String> {
        let held = self.limits.space.is_some() && self.metrics.reachable < IN_SIGHT;
        held.then(|| {
            format!(
                "{:.0}% of the surface is seen from nowhere in the space that cameras are held to; it counts neither as seen nor as a hole",
                100.0 * (1.0 - self.metrics.reachable)
            )
        })
    }

    /// What a user should look at before following the plan, each on one line.
    pub fn doubts(&self) -> Vec<String> {
        let mut doubts = Vec::new();
        if let Some(expected) = self.expected.as_ref().filter(|expected| expected.unseen > BLIND) {
            let elsewhere = match self.limits.narrows() {
                true => {
                    "; viewers stand also where heights or ground keep cameras from, unless other viewers are given"
                }
                false => "",
            };
            doubts.push(format!(
                "much of what viewers look at is seen by no camera ({:.0}%): more views help, or wider limits (heights, walk, box){elsewhere}",
                100.0 * expected.unseen
            ));
        }
        if let Some([low, high]) = self.elsewhere {
            doubts.push(format!(
                "these cameras stand outside of what walls enclose, from {low:.2} to {high:.2}: where that is the room, give its box"
            ));
        }
        let legs = self.tour.as_ref().map_or(0, |tour| tour.blocked);
        if legs > 0 {
            doubts.push(format!("legs of the tour that lead through the surface or a limit: {legs}; go around"));
        }
        doubts.extend(self.connection.iter().filter(|c| !c.is_whole()).map(Connection::line));
        let proven = self.limits.space.as_ref().is_some_and(|space| space.reach().is_some());
        if proven && self.region.floor.is_none() && self.limits.walls.is_empty() {
            doubts.push("neither a floor nor a wall limits these cameras: see in the 3D view that up is up".into());
        }
        doubts
    }
}
