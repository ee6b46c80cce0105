//! Choosing by a model of the scene: FisherRF (Jiang, Lei and Daniilidis, "FisherRF: Active View Selection and Uncertainty
//! Quantification for Radiance Fields using Fisher Information", 2024), the criteria of optimal design (Wilson et al., "POp-GS", 2025) and
//! COVER, on one fixed model.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::farthest::Distance;
use super::greedy::{Knowledge, grow};
use super::pool::Pool;
use crate::engine::vulkan::Context;
use crate::scene::gaussians::Gaussians;
use crate::splats::uncertainty::cover::Cover;
use crate::splats::uncertainty::fisher::{Criterion, Fisher};
use crate::{Error, Result};

/// Trained splats of the scene, in the photos' world.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Where they were read from.
    pub path: String,
    /// The splats.
    pub gaussians: Gaussians,
    /// Whether they were trained with opacities reduced by what the low-pass widens.
    pub antialiased: bool,
}

/// InformationSettings of FisherRF and COVER.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct InformationSettings {
    /// Added to what is known of each parameter, by FisherRF.
    pub lambda: f32,
    /// Views by farthest view sampling to begin with, where there are none.
    pub first: u32,
    /// What Fisher information is compared by.
    #[serde(default, skip_serializing_if = "Criterion::is_usual")]
    pub criterion: Criterion,
}

impl Default for InformationSettings {
    fn default() -> Self {
        Self { lambda: 1e-6, first: 4, criterion: Criterion::Ratio }
    }
}

/// FisherRF: after the photos that are chosen in any case, or else a few by farthest view sampling, always the one whose Fisher
/// information is worth most beside that of those chosen, by the criterion. Lenses count as pinholes.
///
/// # Errors
/// A model that none of the photos shows, or a device that fails.
pub fn fisher(
    context: &Arc<Context>,
    pool: &Pool<'_>,
    model: &Model,
    settings: InformationSettings,
) -> Result<Vec<usize>> {
    let Model { path, gaussians, antialiased } = model;
    let InformationSettings { lambda, first, criterion } = settings;
    let cameras = pool.set.cameras();
    let mut fisher = Fisher::new(context, gaussians.clone(), &cameras, *antialiased, lambda)?.by(criterion);
    choose(&mut fisher, pool, path, first)
}

/// COVER: as [`fisher`], but always the photo that shows most of the model from directions that it has not been seen from.
///
/// # Errors
/// As [`fisher`].
pub fn cover(
    context: &Arc<Context>,
    pool: &Pool<'_>,
    model: &Model,
    settings: InformationSettings,
) -> Result<Vec<usize>> {
    let Model { path, gaussians, antialiased } = model;
    let mut cover = Cover::new(context, gaussians.clone(), &pool.set.cameras(), *antialiased)?;
    choose(&mut cover, pool, path, settings.first)
}

fn choose(knowledge: &mut impl Knowledge, pool: &Pool<'_>, path: &str, first: u32) -> Result<Vec<usize>> {
    let mut seen = false;
    for photo in pool.allowed {
        seen = seen || knowledge.worth(*photo)? > 0.0;
    }
    if !seen {
        return Err(Error::input(path, "none of the views shows it; are they in the model's frame?"));
    }
    let begin = beginning(pool, first);
    let free: Vec<usize> = pool.allowed.iter().copied().filter(|photo| !begin.contains(photo)).collect();
    grow(knowledge, begin, &free, pool.count)
}

/// The photos that are chosen in any case, or else a few by farthest view sampling.
pub(super) fn beginning(pool: &Pool<'_>, first: u32) -> Vec<usize> {
    match pool.include {
        [] => {
            let few = Pool { count: pool.count.min(first as usize), ..*pool };
            few.farthest(Distance::GreatCircle)
        }
        include => include.to_vec(),
    }
}
