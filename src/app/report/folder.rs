//! The folder that a plan leaves: poses in every format, visualisations, and the record.

use glam::DVec3;

use super::shots::Shots;
use super::{Cloud, ReportScene, SurfacePoint, Triangles, decimate};
use crate::error::{Error, Result};
use crate::files::io::camera_files;
use crate::files::io::folder::OutputFolder;
use crate::files::photos::PhotoSet;
use crate::planner::plan::pipeline::Plan;
use crate::planner::plan::target::Target;
use crate::scene::proxy::{self, Occluder};
use crate::scene::surface::Points;

/// Stream of the points that trainers start from.
pub(super) const SEED_STREAM: u32 = 2;
/// How many there are.
pub(super) const SEED_POINTS: usize = 5000;
/// Triangles that the page shows at most.
const MAX_TRIANGLES: usize = 60_000;
/// Pairs of point and camera up to which tracks are worth their rays.
const MAX_PAIRS: usize = 20_000_000;
/// Colour of planned and of kept cameras in frusta.ply.
const PLANNED: [u8; 3] = [230, 126, 34];
const KEPT: [u8; 3] = [52, 120, 200];

/// Writes `transforms.json`, `sparse/0`, `points.ply`, `cameras.csv`, `frusta.ply`, `coverage.ply`, `plan.json` and
/// `report.html`, where the plan keeps `photos` also `shots.json` and the pictures in `shots`, and commits the folder.
///
/// # Errors
/// When the folder cannot be written, or an image cannot be read.
pub fn write(plan: &Plan, target: &Target, photos: Option<&PhotoSet>, folder: OutputFolder) -> Result<()> {
    let record = &plan.record;
    let seeds = target.proxy.sample(SEED_POINTS, record.seed, SEED_STREAM);
    let tracks = if seeds.len() * record.cameras.len() <= MAX_PAIRS {
        let seen_by = |point: &proxy::SurfacePoint| {
            let at = point.position + point.lift * point.normal;
            let seen = (0u32..).zip(&record.cameras).filter(|(_, camera)| plan.geometry.sees(camera, at));
            seen.map(|(i, _)| i).collect()
        };
        seeds.iter().map(seen_by).collect()
    } else {
        Vec::new()
    };
    let points = Points {
        positions: seeds.iter().map(|point| point.position).collect(),
        colours: seeds.iter().map(|point| point.colour).collect(),
        ..Points::default()
    };
    camera_files::capture(&folder, &record.cameras, &points, &tracks)?;

    let planned = record.cameras.len() - record.kept;
    let colours: Vec<_> = (0..record.cameras.len()).map(|i| if i < planned { PLANNED } else { KEPT }).collect();
    let size = 0.05 * record.region.bounding_sphere().1;
    folder.write("frusta.ply", camera_files::frusta_ply(&record.cameras, &colours, size))?;

    let positions: Vec<DVec3> = plan.points.iter().map(|point| point.position).collect();
    let gaps: Vec<f32> = plan.scores.iter().map(|score| score.gap.to_degrees()).collect();
    folder.write("coverage.ply", camera_files::coverage_ply(&positions, &gaps, (0.0, 60.0)))?;

    let json = serde_json::to_string_pretty(record)
        .map_err(|e| Error::request(format!("plan.json cannot be written: {e}")))?;
    folder.write("plan.json", json)?;
    let shots = match photos {
        Some(photos) => Shots::new(&record.cameras, record.kept, &record.region, photos)?,
        None => None,
    };
    if let Some(shots) = &shots {
        folder.write("shots.json", shots.json()?)?;
        for (shot, picture) in shots.list.shots.iter().zip(&shots.pictures) {
            folder.write(&shot.picture, picture)?;
        }
    }
    folder.write("report.html", page(plan, target, shots.as_ref())?)?;
    folder.commit()
}

fn page(plan: &Plan, target: &Target, shots: Option<&Shots>) -> Result<String> {
    let points: Vec<SurfacePoint> = plan
        .points
        .iter()
        .zip(&plan.scores)
        .zip(&plan.map.points)
        .map(|((point, score), error)| SurfacePoint {
            position: point.position,
            colour: point.colour,
            gap: if score.reachable > 0.0 { score.gap } else { f32::NAN },
            views: score.views,
            score: point.score,
            error: *error,
        })
        .collect();
    let few = match &target.proxy.occluder {
        Occluder::Triangles(corners) => Some(decimate::decimate(corners, target.proxy.colours(), MAX_TRIANGLES)),
        Occluder::Discs(_) => None,
    };
    let triangles = few.as_ref().map(|(corners, colours)| Triangles { corners, colours });
    super::html(
        &plan.record,
        &ReportScene { points: &points, triangles, cloud: Cloud::of(&target.proxy), worst: &plan.map.worst, shots },
    )
}
