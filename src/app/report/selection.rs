//! The folder that a selection leaves: the chosen photos as a capture of their own, what each is worth, what is still
//! unseen, and the record.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fmt::Write as _;
use std::fs;
#[cfg(unix)]
use std::os::unix::fs::symlink;
#[cfg(windows)]
use std::os::windows::fs::symlink_file as symlink;
use std::path::Path;

use glam::DVec3;
use image::{GrayImage, ImageFormat, Luma};
use serde::Serialize;

use super::choice::{Choice, ChosenPhoto, pictures};
use super::folder::{SEED_POINTS, SEED_STREAM};
use super::{Cloud, Kind, ReportScene, SurfacePoint, Triangles, decimate};
use crate::error::{Error, Result};
use crate::files::io::folder::OutputFolder;
use crate::files::io::{camera_files, colmap, ply, transforms};
use crate::files::photos::{Convention, Photo, PhotoSet};
use crate::planner::metrics::{Metrics, PointMetrics};
use crate::planner::plan::record::Expected;
use crate::planner::plan::record::{BaselineRecord, IterationRecord, PlanRecord, Status, SurfaceRecord};
use crate::planner::plan::target::Target;
use crate::planner::select::request::SelectionRequest;
use crate::planner::select::selection::{Chosen, Selection, Suggested};
use crate::scene::camera::{Camera, Intrinsics};
use crate::scene::proxy::Occluder;
use crate::scene::region::Region;

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
    pub request: &'a SelectionRequest,
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
    request: &'a SelectionRequest,
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
/// capture has none), and `sparse/0`.
fn capture(written: &Written<'_>, folder: &OutputFolder) -> Result<Vec<String>> {
    let Written { set, selection, .. } = written;
    let photos: Vec<&Photo> = selection.chosen.iter().map(|chosen| &set.photos[chosen.photo]).collect();
    let Seeds { positions, colours, tracks } = seeds(written);
    folder.write(POINTS, ply::write::points(&positions, &colours, None))?;
    let (text, mut notes) = transforms::write_photos(&photos, Some(POINTS));
    folder.write("transforms.json", text)?;
    if let Some(model) = own_model(set, &photos)? {
        for (name, bytes) in model.files {
            folder.write(&format!("sparse/0/{name}"), bytes)?;
        }
        return Ok(notes);
    }
    let lenses: Option<Vec<colmap::Lens>> =
        photos.iter().map(|photo| colmap::Lens::of(photo.camera.intrinsics, photo.distortion)).collect();
    match lenses {
        Some(lenses) => {
            let cameras: Vec<Camera> = photos.iter().map(|photo| photo.camera.clone()).collect();
            folder.write("sparse/0/cameras.bin", colmap::write::cameras(&lenses))?;
            folder.write("sparse/0/images.bin", colmap::write::images(&cameras, &lenses, &positions, &tracks))?;
            let points = colmap::write::points(&positions, &colours, &cameras, &tracks);
            folder.write("sparse/0/points3D.bin", points)?;
        }
        None => notes.push("sparse/0 is left out: COLMAP has no model for one of the lenses".into()),
    }
    Ok(notes)
}

/// The files of the capture's own COLMAP model, cut down to some photos and else kept to the bit; none where it has no model, or one
/// for images of another size.
fn own_model(set: &PhotoSet, photos: &[&Photo]) -> Result<Option<colmap::Subset>> {
    let (Convention::Colmap, Some(model)) = (set.convention, colmap::model_folder(&set.path)) else {
        return Ok(None);
    };
    let full: HashMap<String, Intrinsics> =
        colmap::cameras(&model, &mut Vec::new())?.into_iter().map(|camera| (camera.name, camera.intrinsics)).collect();
    if photos.iter().any(|photo| full.get(&photo.camera.name) != Some(&photo.camera.intrinsics)) {
        return Ok(None);
    }
    let names: Vec<String> = photos.iter().map(|photo| photo.camera.name.clone()).collect();
    colmap::subset(&model, &names).map(Some)
}

/// What a trainer may start from.
struct Seeds {
    positions: Vec<DVec3>,
    colours: Vec<[u8; 3]>,
    /// Which of the chosen photos saw each point; empty where nothing says so.
    tracks: Vec<Vec<u32>>,
}

/// The points of the capture that a chosen photo saw, or all where nothing says who saw what; where that leaves none, points of the
/// surface.
fn seeds(written: &Written<'_>) -> Seeds {
    let Written { set, selection, target, request, .. } = written;
    let chosen = |photo: &u32| selection.chosen.binary_search_by_key(&(*photo as usize), |c| c.photo).ok();
    let kept: Vec<usize> = (0..set.points.positions.len())
        .filter(|point| set.tracks.get(*point).is_none_or(|track| track.iter().any(|photo| chosen(photo).is_some())))
        .collect();
    if kept.is_empty() {
        let seeds = target.proxy.sample(SEED_POINTS, request.seed, SEED_STREAM);
        let (positions, colours) = seeds.iter().map(|point| (point.position, point.colour)).unzip();
        return Seeds { positions, colours, tracks: Vec::new() };
    }
    let track =
        |point: &usize| Some(set.tracks.get(*point)?.iter().filter_map(|photo| Some(chosen(photo)? as u32)).collect());
    Seeds {
        positions: kept.iter().map(|point| set.points.positions[*point]).collect(),
        colours: kept.iter().filter_map(|point| set.points.colours.get(*point).copied()).collect(),
        tracks: kept.iter().filter_map(track).collect(),
    }
}

/// Links or copies the chosen images to `images/` and their masks to `masks/`. Where some have masks the others get white ones, since
/// trainers want one for each photo or none.
fn images(written: &Written<'_>, folder: &OutputFolder) -> Result<()> {
    let place = |from: &Path, name: String| -> Result<()> {
        let to = folder.stage(&name)?;
        let done = if written.copy {
            fs::copy(from, &to).map(|_| ())
        } else {
            fs::canonicalize(from).and_then(|from| symlink(from, &to))
        };
        done.map_err(|source| Error::io(from, source))
    };
    let chosen = || written.selection.chosen.iter().map(|chosen| &written.set.photos[chosen.photo]);
    let has_masks = chosen().any(|photo| photo.mask.is_some());
    // By size: encoding one takes longer than all the rest.
    let mut whites: HashMap<[u32; 2], Vec<u8>> = HashMap::new();
    for photo in chosen() {
        let name = photo.camera.image_name();
        if let Some(image) = &photo.image {
            place(image, format!("images/{name}"))?;
        }
        let mask = format!("masks/{name}.png");
        match &photo.mask {
            Some(file) => place(file, mask)?,
            None if has_masks => {
                let k = &photo.camera.intrinsics;
                let white = match whites.entry([k.width, k.height]) {
                    Entry::Occupied(known) => known.into_mut(),
                    Entry::Vacant(new) => new.insert(white(k)?),
                };
                folder.write(&mask, &*white)?;
            }
            None => {}
        }
    }
    Ok(())
}

/// A PNG file of a mask that hides nothing.
fn white(k: &Intrinsics) -> Result<Vec<u8>> {
    let mut file = std::io::Cursor::new(Vec::new());
    let written = GrayImage::from_pixel(k.width, k.height, Luma([255])).write_to(&mut file, ImageFormat::Png);
    written.map_err(|e| Error::request(format!("a mask of {} x {} pixels: {e}", k.width, k.height)))?;
    Ok(file.into_inner())
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
        elsewhere: None,
        metrics: selection.metrics,
        baselines: selection.baselines.clone(),
        seconds: selection.seconds.iter().sum(),
    };
    super::html_of(
        &record,
        &ReportScene {
            points: &points,
            triangles,
            cloud: Cloud::of(&target.proxy),
            worst: &selection.map.worst,
            shots: None,
        },
        Kind::Selection(&Choice { pool: &selection.pool, photos: &chosen_photos(written)?, suggested }),
    )
}
