//! Choices among photos by a rule, without swaps: what swaps begin with, baselines of a selection, and baselines of a plan that choose
//! among random poses.

use std::sync::Arc;

use super::farthest::Distance;
use super::information::Model;
use super::pool::Pool;
use super::retrained::Photograph;
use super::{acp, information, retrained};
use crate::engine::vulkan::Context;
use crate::planner::methods::Method;
use crate::scene::camera::Pose;
use crate::scene::layouts;
use crate::scene::proxy::Proxy;
use crate::splats::uncertainty::fisher::Criterion;
use crate::visibility::device_scene::SceneGeometry;
use crate::{Error, Result};

/// Photos up to which all pairs are worth counting shared points of.
const MAX_SHARED: usize = 4000;

/// A rule that chooses photos.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// A different photo for each planned camera, by the least sum of distances.
    Assigned,
    /// For each planned camera the nearest photo.
    Nearest,
    /// At random.
    Random,
    /// A different photo for each point of a Fibonacci sphere.
    Fibonacci,
    /// Again and again the photo that is farthest from those chosen.
    Farthest(Distance),
    /// Greedy coverage of points.
    Coverage,
    /// Uniformity and frequency at nodes of a grid.
    Acp(acp::AcpSettings),
    /// Fisher information about a trained model.
    Fisher(information::InformationSettings),
    /// The same about a model that is trained on the photos chosen so far.
    FisherRetrain(retrained::RetrainingSettings),
    /// What a trained model shows from directions not seen yet.
    Cover(information::InformationSettings),
}

/// What rules choose with, beside the pool.
pub struct Means<'m> {
    /// The device.
    pub context: &'m Arc<Context>,
    /// The surface and the region.
    pub geometry: &'m SceneGeometry,
    /// The surface that models are trained from.
    pub proxy: &'m Proxy,
    /// Cameras of a plan, in the world of the photos.
    pub planned: &'m [Pose],
    /// A trained model, for the rules that choose by one.
    pub model: Option<&'m Model>,
    /// Takes photographs, for the rule that trains.
    pub photograph: Photograph<'m>,
}

impl Method {
    /// The rule by which it chooses, with default settings; none where it is a search or places cameras.
    pub fn rule(self) -> Option<Rule> {
        Some(match self {
            Self::Assigned => Rule::Assigned,
            Self::Nearest => Rule::Nearest,
            Self::Random => Rule::Random,
            Self::Fibonacci => Rule::Fibonacci,
            Self::Fvs => Rule::Farthest(Distance::GreatCircle),
            Self::FvsChord => Rule::Farthest(Distance::Chord),
            Self::FvsShared => Rule::Farthest(Distance::Shared),
            Self::Coverage => Rule::Coverage,
            Self::Acp | Self::AcpHidden => {
                Rule::Acp(acp::AcpSettings { occlusion: self == Self::AcpHidden, ..Default::default() })
            }
            Self::Fisher | Self::PopD | Self::PopT => {
                Rule::Fisher(information::InformationSettings { criterion: self.criterion(), ..Default::default() })
            }
            Self::FisherRetrain => Rule::FisherRetrain(retrained::RetrainingSettings::default()),
            Self::Cover => Rule::Cover(information::InformationSettings::default()),
            _ => return None,
        })
    }
}

impl Method {
    /// What it compares information by, where it does.
    pub(crate) fn criterion(self) -> Criterion {
        match self {
            Self::PopD => Criterion::Determinant,
            Self::PopT => Criterion::Trace,
            _ => Criterion::Ratio,
        }
    }
}

impl Rule {
    /// Whether it needs to know what the photos see.
    pub fn needs_sight(self) -> bool {
        matches!(self, Self::Coverage | Self::Farthest(Distance::Shared))
    }

    /// Refuses pools of so many photos that the rule would take too long.
    ///
    /// # Errors
    /// In a line that names the method.
    pub fn check(self, photos: usize) -> Result<()> {
        if self == Self::Farthest(Distance::Shared) && photos > MAX_SHARED {
            let what = format!("shared points are counted among up to {MAX_SHARED} photos or candidates");
            return Err(Error::request(format!("`method` fvs-shared: {what}; take fewer, or use fvs")));
        }
        Ok(())
    }

    /// The chosen photos, those chosen in any case first.
    ///
    /// # Errors
    /// A pool too large for the rule, a model that is missing, or a device that fails.
    pub fn choose(self, pool: &Pool<'_>, means: Means<'_>) -> Result<Vec<usize>> {
        self.check(pool.set.photos.len())?;
        let Means { context, geometry, proxy, planned, model, photograph } = means;
        let model = |name: &str| {
            model.ok_or_else(|| Error::request(format!("`method` {name} needs trained splats; give them with `model`")))
        };
        match self {
            Self::Assigned => Ok(pool.assigned(planned)),
            Self::Nearest => Ok(pool.nearest(planned)),
            Self::Random => Ok(pool.random()),
            Self::Fibonacci => {
                let count = pool.count - pool.include.len();
                Ok(pool.assigned(&layouts::fibonacci_shell(pool.region, count)?))
            }
            Self::Farthest(distance) => Ok(pool.farthest(distance)),
            Self::Coverage => Ok(pool.coverage()),
            Self::Acp(settings) => acp::choose(pool, settings, settings.occlusion.then_some(geometry)),
            Self::Fisher(settings) => {
                let method = match settings.criterion {
                    Criterion::Ratio => Method::Fisher,
                    Criterion::Determinant => Method::PopD,
                    Criterion::Trace => Method::PopT,
                };
                information::fisher(context, pool, model(method.name())?, settings)
            }
            Self::FisherRetrain(settings) => retrained::fisher(context, pool, proxy, settings, photograph),
            Self::Cover(settings) => information::cover(context, pool, model("cover")?, settings),
        }
    }
}
