//! The order that planned cameras are written in.

use clap::ValueEnum;

use crate::planner::plan::pipeline::Plan;
use crate::scene::tour;

/// In which order planned cameras are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Order {
    /// A short tour that keeps the clearance.
    Tour,
    /// As they were placed.
    None,
}

impl Order {
    /// Puts the planned cameras into this order.
    pub fn apply(self, plan: &mut Plan) {
        if self == Self::Tour {
            plan.sort_for_a_tour();
            if plan.record.tour.is_none() {
                say!(
                    "note     no tour: it is made of {} cameras at most, and these stay as they were placed",
                    tour::MAX_PLACES
                );
            }
        }
    }
}
