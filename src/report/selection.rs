//! The folder that a selection leaves: the chosen photos as a capture of their own, what each is worth, what is still
//! unseen, and the record.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

use super::choice::{Choice, ChosenPhoto, pictures};
use super::folder::{SEED_POINTS, SEED_STREAM};
use super::{Kind, ReportScene, SurfacePoint, Triangles, decimate};
use crate::error::{Error, Result};
use crate::io::folder::OutputFolder;
use crate::io::{camera_files, colmap, ply, transforms};
use crate::metrics::{Metrics, PointMetrics};
use crate::photos::{Convention, Photo, PhotoSet};
use crate::plan::record::Expected;
use crate::plan::record::{BaselineRecord, IterationRecord, PlanRecord, Status, SurfaceRecord};
use crate::plan::target::Target;
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::proxy::Occluder;
use crate::scene::region::Region;
use crate::select::job::{Chosen, Selection, Suggested};
use crate::select::request::Request;

/// Triangles that the page shows at most.
const MAX_TRIANGLES: usize = 60_000;
/// Photos left out that the page shows at most; the others are left out of the picture too.
const MAX_SHOWN: usize = 3000;

/// The file of points, as transforms.json names it.
const POINTS: &str = "points.ply";

/// Everything that is written.
pub struct Written<'a> {
    /// The capture.
    pub set: &'a PhotoSet,
    /// Its surface.
    pub target: &'a Target,
    /// The request.
    pub request: &'a Request,
    /// The result.
    pub selection: &'a Selection,
    /// Poses worth adding.
    pub suggested: &'a [Suggested],
    /// Device name and driver.
    pub device: String,
    /// Whether images are copied; else linked.
    pub copy: bool,
}

/// The contents of select.json.
#[derive(Serialize)]
struct Record<'a> {
    version: &'static str,
    capture: String,
    surface: &'a SurfaceRecord,
    region: &'a Region,
    device: &'a str,
    request: &'a Request,
    chosen: Vec<ChosenRecord<'a>>,
    metrics: &'a Metrics,
    /// The whole pool.
    all_photos: &'a Metrics,
    baselines: &'a [BaselineRecord],
    expected: &'a Expected,
    errors_db: &'a [f64],
    seconds: [f64; 3],
}

#[derive(Serialize)]
struct ChosenRecord<'a> {
    name: &'a str,
    contribution_db: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    sharpness: Option<f64>,
}

/// Writes everything and commits the folder; returns what of the lenses could not be written.
///
/// # Errors
/// When the folder cannot be written, an image cannot be linked, or the capture's model cannot be read again.
pub fn write(written: &Written<'_>, folder: OutputFolder) -> Result<Vec<String>> {
    let Written { set, selection, suggested, .. } = written;
    images(written, &folder)?;
    let notes = capture(written, &folder)?;
    folder.write("chosen.csv", chosen_csv(written))?;
    let unseen: Vec<DVec3> = selection
        .points
        .iter()
        .zip(&selection.scores)
        .filter(|(_, score)| score.views == 0)
        .map(|(point, _)| point.position)
        .collect();
    // What the pool could show lies at 1, what no photo shows at 0.
    let shown: Vec<f32> = selection
        .scores
        .iter()
        .filter(|score| score.views == 0)
        .map(|score| if score.reachable > 0.0 { 1.0 } else { 0.0 })
        .collect();
    folder.write("unseen.ply", camera_files::coverage_ply(&unseen, &shown, (0.0, 1.0)))?;
    if !suggested.is_empty() {
        let cameras: Vec<Camera> = suggested.iter().map(|one| one.camera.clone()).collect();
        folder.write("suggested.json", transforms::write(&cameras, Some(POINTS)))?;
        folder.write("suggested.csv", suggested_csv(suggested, &camera_files::cameras_csv(&cameras)))?;
    }
    let record = Record {
        version: env!("CARGO_PKG_VERSION"),
        capture: set.path.to_string_lossy().into_owned(),
        surface: &written.target.record,
        region: &written.target.region,
        device: &written.device,
        request: written.request,
        chosen: selection
            .chosen
            .iter()
            .map(|chosen| ChosenRecord {
                name: &set.photos[chosen.photo].camera.name,
                contribution_db: chosen.contribution_db,
                sharpness: chosen.sharpness,
            })
            .collect(),
        metrics: &selection.metrics,
        all_photos: &selection.pool,
        baselines: &selection.baselines,
        expected: &selection.expected,
        errors_db: &selection.errors_db,
        seconds: selection.seconds,
    };
    let json = serde_json::to_string_pretty(&record)
        .map_err(|e| Error::request(format!("select.json cannot be written: {e}")))?;
    folder.write("select.json", json)?;
    folder.write("report.html", page(written)?)?;
    folder.commit()?;
    Ok(notes)
}

/// Writes the capture cut down to the chosen photos: `transforms.json`, the points that they saw (points of the surface where the
/// capture has none), and `sparse/0` where the capture is a COLMAP model.
fn capture(written: &Written<'_>, folder: &OutputFolder) -> Result<Vec<String>> {
    let Written { set, selection, .. } = written;
    let photos: Vec<&Photo> = selection.chosen.iter().map(|chosen| &set.photos[chosen.photo]).collect();
    let mut rescaled = false;
    if let (Convention::Colmap, Some(model)) = (set.convention, colmap::model_folder(&set.path)) {
        let names: Vec<String> = photos.iter().map(|photo| photo.camera.name.clone()).collect();
        // The subset keeps the model's cameras to the bit, which are those of the photos' full size.
        let full: HashMap<String, Intrinsics> = colmap::cameras(&model, &mut Vec::new())?
            .into_iter()
            .map(|camera| (camera.name, camera.intrinsics))
            .collect();
        rescaled = photos.iter().any(|photo| full.get(&photo.camera.name) != Some(&photo.camera.intrinsics));
        let files = if rescaled { Vec::new() } else { colmap::subset(&model, &names)?.files };
        for (name, bytes) in files {
            folder.write(&format!("sparse/0/{name}"), bytes)?;
        }
    }
    let (positions, colours) = points(written);
    folder.write(POINTS, ply::write::points(&positions, &colours, None))?;
    let (text, mut notes) = transforms::write_photos(&photos, Some(POINTS));
    folder.write("transforms.json", text)?;
    if rescaled {
        notes.push(
            "sparse/0 is left out: the images are of another size than the model's; transforms.json has theirs".into(),
        );
    }
    Ok(notes)
}

/// Positions and colours of what a trainer may start from: the capture's points that a chosen photo saw, or all where nothing says
/// who saw what; of a capture without points, points of the surface.
fn points(written: &Written<'_>) -> (Vec<DVec3>, Vec<[u8; 3]>) {
    let Written { set, selection, target, request, .. } = written;
    let is_chosen = |photo: &u32| selection.chosen.binary_search_by_key(&(*photo as usize), |c| c.photo).is_ok();
    let kept: Vec<usize> = (0..set.points.positions.len())
        .filter(|point| set.tracks.get(*point).is_none_or(|track| track.iter().any(is_chosen)))
        .collect();
    if kept.is_empty() {
        let seeds = target.proxy.sample(SEED_POINTS, request.seed, SEED_STREAM);
        return seeds.iter().map(|point| (point.position, point.colour)).unzip();
    }
    let colours = kept.iter().filter_map(|point| set.points.colours.get(*point).copied()).collect();
    (kept.iter().map(|point| set.points.positions[*point]).collect(), colours)
}

/// Links or copies the chosen images to `images/` and their masks to `masks/`.
fn images(written: &Written<'_>, folder: &OutputFolder) -> Result<()> {
    let place = |from: &Path, name: String| -> Result<()> {
        let to = folder.stage(&name)?;
        let done = if written.copy {
            fs::copy(from, &to).map(|_| ())
        } else {
            fs::canonicalize(from).and_then(|from| std::os::unix::fs::symlink(from, &to))
        };
        done.map_err(|source| Error::io(from, source))
    };
    for chosen in &written.selection.chosen {
        let photo = &written.set.photos[chosen.photo];
        let name = photo.camera.image_name();
        if let Some(image) = &photo.image {
            place(image, format!("images/{name}"))?;
        }
        if let Some(mask) = &photo.mask {
            place(mask, format!("masks/{name}.png"))?;
        }
    }
    Ok(())
}

/// The chosen photos, those that the choice would miss most first.
fn by_contribution(selection: &Selection) -> Vec<&Chosen> {
    let mut chosen: Vec<_> = selection.chosen.iter().collect();
    chosen.sort_by(|a, b| b.contribution_db.total_cmp(&a.contribution_db).then(a.photo.cmp(&b.photo)));
    chosen
}

/// The chosen photos as the page shows them, in the order of the selection.
fn chosen_photos(written: &Written<'_>) -> Result<Vec<ChosenPhoto>> {
    let Written { set, selection, request, .. } = written;
    let order = by_contribution(selection);
    let photos: Vec<Photo> = order.iter().map(|chosen| set.photos[chosen.photo].clone()).collect();
    let mut shown: Vec<(usize, ChosenPhoto)> = (1..)
        .zip(order)
        .zip(pictures(&photos)?)
        .map(|((rank, chosen), picture)| {
            let photo = ChosenPhoto {
                name: set.photos[chosen.photo].camera.name.clone(),
                rank,
                of: photos.len(),
                contribution_db: chosen.contribution_db,
                sharpness: chosen.sharpness,
                included: request.include.contains(&chosen.photo),
                picture,
            };
            (chosen.photo, photo)
        })
        .collect();
    shown.sort_by_key(|(photo, _)| *photo);
    Ok(shown.into_iter().map(|(_, photo)| photo).collect())
}

/// Text of chosen.csv: the photos, those that the choice would miss most first.
fn chosen_csv(written: &Written<'_>) -> String {
    let mut text = String::from("name,contribution_db,sharpness\n");
    for row in by_contribution(written.selection) {
        let name = &written.set.photos[row.photo].camera.name;
        let sharpness = row.sharpness.map(|s| format!("{s:.3}")).unwrap_or_default();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{},{:.6},{sharpness}", quoted(name), row.contribution_db);
    }
    text
}

/// The table of cameras with what each would add by itself.
fn suggested_csv(suggested: &[Suggested], cameras: &str) -> String {
    let gains = suggested.iter().map(|one| format!("{:.4}", one.gain_db));
    let columns = std::iter::once("gain_db".to_owned()).chain(gains);
    cameras.lines().zip(columns).map(|(line, gain)| format!("{line},{gain}\n")).collect()
}

/// A field of a CSV file (RFC 4180).
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field.into() }
}

/// A held-out point as the page has it.
fn surface_point(((point, score), error): ((&crate::scene::proxy::SurfacePoint, &PointMetrics), &f32)) -> SurfacePoint {
    SurfacePoint {
        position: point.position,
        colour: point.colour,
        gap: if score.reachable > 0.0 { score.gap } else { f32::NAN },
        views: score.views,
        score: point.score,
        error: *error,
    }
}

fn page(written: &Written<'_>) -> Result<String> {
    let Written { set, target, request, selection, suggested, .. } = written;
    let points: Vec<SurfacePoint> =
        selection.points.iter().zip(&selection.scores).zip(&selection.map.points).map(surface_point).collect();
    let few = match &target.proxy.occluder {
        Occluder::Triangles(corners) => Some(decimate::decimate(corners, target.proxy.colours(), MAX_TRIANGLES)),
        Occluder::Discs(_) => None,
    };
    let triangles = few.as_ref().map(|(corners, colours)| Triangles { corners, colours });
    let is_chosen = |photo: &usize| selection.chosen.iter().any(|chosen| chosen.photo == *photo);
    let others = (0..set.photos.len()).filter(|photo| !is_chosen(photo));
    let left_out: Vec<usize> = others.step_by(set.photos.len().div_ceil(MAX_SHOWN).max(1)).collect();
    let shown = selection.chosen.iter().map(|chosen| chosen.photo).chain(left_out.iter().copied());
    let record = PlanRecord {
        version: env!("CARGO_PKG_VERSION").into(),
        status: Status::Complete,
        method: request.method.name().into(),
        surface: target.record.clone(),
        device: written.device.clone(),
        seed: request.seed,
        config: serde_json::to_value(request)
            .map_err(|e| Error::request(format!("the request cannot be written: {e}")))?,
        region: target.region,
        limits: target.limits.clone(),
        cameras: shown.map(|photo| set.photos[photo].camera.clone()).collect(),
        kept: left_out.len(),
        history: (0..)
            .zip(&selection.errors_db)
            .map(|(iteration, cost)| IterationRecord { iteration, loss: *cost as f32, ..IterationRecord::default() })
            .collect(),
        checkpoints: Vec::new(),
        expected: Some(selection.expected.clone()),
        began_from: None,
        connection: None,
        tour: None,
        metrics: selection.metrics,
        baselines: selection.baselines.clone(),
        seconds: selection.seconds.iter().sum(),
    };
    super::html_of(
        &record,
        &ReportScene { points: &points, triangles, worst: &selection.map.worst },
        Kind::Selection(&Choice { pool: &selection.pool, photos: &chosen_photos(written)?, suggested }),
    )
}
