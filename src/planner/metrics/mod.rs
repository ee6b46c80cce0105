//! How good a set of cameras is, measured on points that no optimiser has used (hard gate, exact occlusion).

pub mod score_point;

use serde::{Deserialize, Serialize};

/// What one surface point gets from a set of cameras. Angles in radians, areas in steradians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PointMetrics {
    /// Cameras that see the point.
    pub views: u32,
    /// Solid angle of the directions from which the feasible region sees the point.
    pub reachable: f32,
    /// Mean, over reachable directions, of the angle to the nearest view that sees the point; pi where none does.
    pub gap: f32,
    /// Mean spherical Voronoi cell area of the views that see the point, over reachable directions.
    pub voronoi_mean: f32,
    /// Standard deviation of those areas.
    pub voronoi_deviation: f32,
    /// Largest angle between two views that see the point; zero with fewer than two.
    pub triangulation: f32,
    /// Smallest ground sampling distance over the views: world units that a pixel covers, zero where unseen.
    pub sampling_distance: f32,
}

/// The metrics of a set of cameras over all held-out points that can be reached from the region at all.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Metrics {
    /// Held-out points that were scored.
    pub points: usize,
    /// Fraction of all points that some feasible position sees: the most that coverage can be.
    pub reachable: f64,
    /// Fraction of all points seen by at least one view.
    pub coverage_1: f64,
    /// Fraction of all points seen by at least three views.
    pub coverage_3: f64,
    /// Mean views per reachable point.
    pub views_mean: f64,
    /// Coefficient of variation of views per reachable point.
    pub views_variation: f64,
    /// Mean over reachable points of the angular gap, degrees.
    pub gap_mean_deg: f64,
    /// 95th percentile over reachable points of the angular gap, degrees.
    pub gap_p95_deg: f64,
    /// Mean spherical Voronoi cell area over seen points, steradians.
    pub voronoi_mean: f64,
    /// Mean over seen points of the deviation of the cell areas, steradians.
    pub voronoi_deviation: f64,
    /// Mean over points with two views or more of the largest angle between two views, degrees.
    pub triangulation_mean_deg: f64,
    /// Mean over seen points of the smallest ground sampling distance, world units per pixel.
    pub sampling_distance_mean: f64,
}
