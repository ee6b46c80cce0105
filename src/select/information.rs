//! Choosing by a model of the scene: FisherRF (Jiang, Lei and Daniilidis, "FisherRF: Active View Selection and Uncertainty
//! Quantification for Radiance Fields using Fisher Information", 2024), on one fixed model.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::controls::Pool;
use super::farthest::Distance;
use super::greedy::grow;
use crate::gaussians::fisher::Fisher;
use crate::scene::gaussians::Gaussians;
use crate::vulkan::Context;
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

/// What can be chosen about FisherRF.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Added to what is known of each parameter.
    pub lambda: f32,
    /// Views by farthest view sampling to begin with, where there are none.
    pub first: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { lambda: 1e-6, first: 4 }
    }
}

/// FisherRF: after the photos that are chosen in any case, or else a few by farthest view sampling, always the one whose Fisher
/// information is largest beside that of those chosen. Lenses count as pinholes.
///
/// # Errors
/// A model that none of the photos shows, or a device that fails.
pub fn fisher(context: &Arc<Context>, pool: &Pool<'_>, model: &Model, settings: Settings) -> Result<Vec<usize>> {
    let Model { path, gaussians, antialiased } = model;
    let Settings { lambda, first } = settings;
    let cameras = pool.set.cameras();
    let mut fisher = Fisher::new(context, gaussians.clone(), &cameras, *antialiased, lambda)?;
    let mut seen = false;
    for photo in pool.allowed {
        seen = seen || fisher.worth(*photo)? > 0.0;
    }
    if !seen {
        let what = "none of the views shows it; are they in the model's frame?";
        return Err(Error::input(path, what));
    }
    let begin = match pool.must {
        [] => {
            Pool { count: pool.count.min(first as usize), ..*pool }.farthest(Distance::GreatCircle).unwrap_or_default()
        }
        must => must.to_vec(),
    };
    let free: Vec<usize> = pool.allowed.iter().copied().filter(|photo| !begin.contains(photo)).collect();
    grow(&mut fisher, begin, &free, pool.count)
}
