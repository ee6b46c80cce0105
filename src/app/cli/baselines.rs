//! `camsplat plan --method`: the options of the baselines, and a plan of one.

use std::sync::Arc;

use clap::Args;

use super::options::{ModelOptions, method_parser, print_messages};
use super::order::Order;
use super::outcome::print_plan;
use super::progress::stop_on_interrupt;
use super::session::Ended;
use crate::app::report;
use crate::engine::vulkan::Context;
use crate::files::io::folder::OutputFolder;
use crate::files::photos::PhotoSet;
use crate::lab::baselines::placing;
use crate::lab::baselines::request::BaselineRequest;
use crate::planner::methods::Method;
use crate::planner::plan::config::Config;
use crate::planner::plan::problem::Problem;
use crate::planner::select::information::Model;
use crate::{Error, Result};

/// How cameras are placed, where not by the planner.
#[derive(Args, Debug)]
#[command(next_help_heading = "Baselines (docs/reference/baselines.md)")]
pub struct BaselineOptions {
    /// How to place the cameras
    #[arg(long, value_parser = method_parser(|entry| entry.places), default_value = "ours")]
    pub method: Method,
    /// Random poses that a method chooses from [default: fvs, fvs-chord: 10000; fvs-shared, coverage, greedy: 2000; acp, acp-hidden:
    /// 1000; fisherrf, pop-d, pop-t, cover: 300, or three per view]
    #[arg(long, value_name = "N")]
    pub candidates: Option<u32>,
    /// Nodes of the grid along a side [acp, acp-hidden; default: 32]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub nodes: Option<u32>,
    /// Perturbed renderings of a view in an ascent step [manifold; default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=64))]
    pub renders: Option<u32>,
    /// Ascent steps of each camera [manifold; default: 401]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    pub steps: Option<u32>,
    /// Longer side of the pictures that are compared, in pixels at most [manifold; default: 128]
    #[arg(long, value_name = "PIXELS", value_parser = clap::value_parser!(u32).range(8..=4096))]
    pub look_size: Option<u32>,
    /// Steps of learning the model's noise before the first camera is placed [manifold; default: 200]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    pub noise_steps: Option<u32>,
    #[command(flatten)]
    pub model: ModelOptions,
}

/// A baseline that is to place the cameras.
pub struct Baseline {
    /// What is asked of it.
    pub request: BaselineRequest,
    /// The trained splats that it chooses by.
    model: Option<Model>,
}

impl BaselineOptions {
    /// What is asked of a baseline; none where the planner is to place the cameras.
    ///
    /// # Errors
    /// An option that the method does not take.
    pub fn request(&self, config: &Config) -> Result<Option<Baseline>> {
        if self.method.needs_photographs() {
            return Err(placing::no_photographs(self.method));
        }
        let model = self.model.read(self.method.name(), self.method.needs_model())?;
        if self.nodes.is_some() && !matches!(self.method, Method::Acp | Method::AcpHidden) {
            return Err(Error::request("--nodes is for --method acp and acp-hidden; leave it out"));
        }
        let of_manifold = [self.renders, self.steps, self.look_size, self.noise_steps];
        if of_manifold.iter().any(Option::is_some) && self.method != Method::Manifold {
            let what = "--renders, --steps, --look-size and --noise-steps are for --method manifold; leave them out";
            return Err(Error::request(what));
        }
        if self.method.planner(config).is_some() {
            return match self.candidates {
                Some(_) => Err(Error::request("--candidates is for methods that choose; give one with --method")),
                None => Ok(None),
            };
        }
        let mut request = BaselineRequest::new(self.method, self.candidates, config)?;
        if let Some(acp) = &mut request.acp {
            acp.grid = self.nodes.unwrap_or(acp.grid);
        }
        if let Some(manifold) = &mut request.manifold {
            manifold.renders = self.renders.unwrap_or(manifold.renders);
            manifold.steps = self.steps.unwrap_or(manifold.steps);
            manifold.side = self.look_size.unwrap_or(manifold.side);
            manifold.learn = self.noise_steps.unwrap_or(manifold.learn);
        }
        request.model = model.as_ref().map(|model| model.path.clone());
        Ok(Some(Baseline { request, model }))
    }
}

/// Places cameras as a baseline does, writes the folder and prints what came out.
pub fn run(
    context: &Arc<Context>,
    baseline: &Baseline,
    problem: &Problem<'_>,
    photos: Option<&PhotoSet>,
    order: Order,
    folder: OutputFolder,
) -> Result<Ended> {
    let mut plan = placing::run(context, problem, &baseline.request, baseline.model.as_ref())?;
    order.apply(&mut plan);
    print_messages(context);
    // From here on the first Ctrl-C is not heard, so that no half of a folder is left.
    stop_on_interrupt()?;
    let path = folder.path().to_owned();
    report::folder::write(&plan, problem.target, photos, folder)?;
    print_plan(&plan);
    say!("report   {}", path.join("report.html").display());
    Ok(Ended::Done)
}
