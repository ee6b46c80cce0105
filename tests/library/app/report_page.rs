//! The report page, opened in a real browser where there is one: scripts must run, plots must hold data and the 3D view
//! must draw. The pages stay in the test's folder under the target directory, to be looked at.

use crate::support::browser::{figure, number_after, rendered, write};
use camsplat::app::report::{ReportScene, SurfacePoint, Triangles, html};
use camsplat::planner::metrics::Metrics;
use camsplat::planner::plan::record::{
    BaselineRecord, CheckpointRecord, Expected, IterationRecord, PlanRecord, Status, SurfaceRecord,
};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::known::KnownSpace;
use camsplat::scene::limits::Limits;
use camsplat::scene::region::{Region, Shape};
use camsplat::scene::sight::Sight;
use glam::DVec3;

/// A test scene: a record, and geometry to draw it with.
pub struct Stage {
    pub record: PlanRecord,
    points: Vec<SurfacePoint>,
    corners: Vec<[DVec3; 3]>,
    colours: Vec<[u8; 3]>,
}

impl Stage {
    pub fn page(&self) -> String {
        let triangles =
            (!self.corners.is_empty()).then_some(Triangles { corners: &self.corners, colours: &self.colours });
        html(&self.record, &ReportScene { points: &self.points, triangles, cloud: None, worst: &[], shots: None })
            .unwrap()
    }
}

/// The fractional part of multiples of irrational numbers: even, and the same on every run.
fn spread(i: usize) -> [f64; 3] {
    [0.819_172_513, 0.671_043_607, 0.549_700_478].map(|a| (a * (i as f64 + 0.5)).fract())
}

fn direction(i: usize, n: usize) -> DVec3 {
    let z = 1.0 - (2.0 * i as f64 + 1.0) / n as f64;
    let angle = i as f64 * 2.399_963_229_728_653;
    DVec3::new(angle.cos(), angle.sin(), 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
}

/// A point with the mean gap to the five nearest of the cameras that face it, and made-up scores.
fn point(position: DVec3, normal: DVec3, colour: [u8; 3], cameras: &[Camera]) -> SurfacePoint {
    let mut angles: Vec<f64> = Vec::new();
    for camera in cameras {
        let to_camera = (camera.pose.position - position).normalize();
        let half = 0.5 * camera.intrinsics.inscribed_cone();
        if to_camera.dot(normal) > 0.05 && camera.pose.forward().dot(-to_camera) > half.cos() {
            angles.push(to_camera.angle_between(normal));
        }
    }
    angles.sort_by(f64::total_cmp);
    let near = &angles[..angles.len().min(5)];
    let gap = if near.is_empty() { std::f64::consts::PI } else { 0.6 * near.iter().sum::<f64>() / near.len() as f64 };
    let score = 1.5 + 0.5 * (3.0 * position.x).sin() * (2.0 * position.z).cos();
    SurfacePoint {
        position,
        colour,
        gap: gap as f32,
        views: angles.len() as u32,
        score: score as f32,
        error: gap as f32,
    }
}

fn metrics(quality: f64) -> Metrics {
    Metrics {
        points: 20_000,
        reachable: 0.995,
        coverage_1: 0.985 - 0.08 * (1.0 - quality),
        coverage_3: 0.96 - 0.2 * (1.0 - quality),
        views_mean: 14.0 + 4.0 * quality,
        views_variation: 0.6 - 0.3 * quality,
        gap_mean_deg: 28.0 - 14.0 * quality,
        gap_p95_deg: 56.0 - 39.0 * quality,
        voronoi_mean: 0.62 - 0.2 * quality,
        voronoi_deviation: 0.5 - 0.25 * quality,
        triangulation_mean_deg: 88.0 + 12.0 * quality,
        sampling_distance_mean: 0.0023,
    }
}

fn record(path: &str, region: Region, cameras: Vec<Camera>, kept: usize) -> PlanRecord {
    let progress = |i: u32| 1.0 - (-f64::from(i) / 150.0).exp();
    let history = (0..1000).map(|i| {
        let [noise, other, _] = spread(i as usize);
        let image = (3e-3 * (1.0 - 0.9 * progress(i)) * (0.9 + 0.2 * noise)) as f32;
        let reg = (4e-4 * (1.0 - 0.97 * progress(i)) * (0.9 + 0.2 * other)) as f32;
        let bound = if i < 200 { (1e-3 * (-f64::from(i) / 30.0).exp()) as f32 } else { 0.0 };
        let scale = 0.18 - 0.05 * progress(i) as f32;
        IterationRecord { iteration: i, loss: image + 3.0 * reg + 10.0 * bound, image, reg, bound, scale: Some(scale) }
    });
    let checkpoints = (0..=20).map(|k| {
        let m = metrics(progress(50 * k));
        CheckpointRecord {
            iteration: 50 * k,
            metrics: m,
            voronoi_low_vds: Some(1.1 * m.voronoi_mean),
            voronoi_high_vds: Some(m.voronoi_mean * (1.05 - 0.25 * progress(50 * k))),
        }
    });
    let baseline = |name: &str, quality| BaselineRecord { name: name.into(), metrics: metrics(quality) };
    let (centre, radius) = region.bounding_sphere();
    PlanRecord {
        version: "0.1.0".into(),
        status: Status::Complete,
        method: "ours".into(),
        surface: SurfaceRecord {
            path: path.into(),
            kind: "mesh".into(),
            primitives: 48_200,
            assumed: None,
            subject: None,
            min: centre - radius,
            max: centre + radius,
        },
        device: "llvmpipe (LLVM 19.1.7, 256 bits), Mesa 25.0".into(),
        seed: 7,
        config: serde_json::json!({ "objective": "splat", "iterations": 1000, "gate": "pinhole" }),
        region,
        limits: Limits::default(),
        cameras,
        kept,
        history: history.collect(),
        checkpoints: checkpoints.collect(),
        metrics: metrics(1.0),
        expected: None,
        began_from: None,
        connection: None,
        tour: None,
        elsewhere: None,
        baselines: vec![baseline("random", 0.0), baseline("fibonacci", 0.55)],
        seconds: 83.4,
    }
}

/// A unit ball with dimples of colour on it, and 50 cameras on a shell above a floor.
pub fn ball() -> Stage {
    let intrinsics = Intrinsics::from_fov(1920, 1280, 50f64.to_radians());
    let cameras: Vec<Camera> = (0..50)
        .map(|i| {
            let d = direction(i, 64);
            let position = d * (2.4 + 0.4 * spread(i)[0]);
            let pose = Pose::looking(position, -d, DVec3::Z);
            Camera { name: format!("view_{i:03}.png"), pose, intrinsics }
        })
        .collect();
    let tint = |p: DVec3| {
        let wave = (9.0 * p.x).sin() * (9.0 * p.y).sin() * (9.0 * p.z).cos();
        if wave > 0.0 { [196, 120, 74] } else { [232, 214, 186] }
    };
    let at = |row: usize, column: usize| {
        let (theta, phi) = (row as f64 / 60.0 * std::f64::consts::PI, column as f64 / 120.0 * std::f64::consts::TAU);
        DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos())
    };
    let mut corners = Vec::new();
    for (row, column) in (0..60).flat_map(|row| (0..120).map(move |column| (row, column))) {
        let [a, b, c, d] = [at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1)];
        corners.extend([[a, b, c], [a, c, d]]);
    }
    let points = (0..6000).map(|i| {
        let p = direction(i, 6000);
        let mut point = point(p, p, tint(p), &cameras);
        if p.z < -0.96 {
            (point.gap, point.views) = (f32::NAN, 0);
        }
        point
    });
    let region = Region {
        shape: Shape::Shell { centre: DVec3::ZERO, r_min: 2.2, r_max: 3.0 },
        up: DVec3::Z,
        floor: Some(-1.0),
        clearance: 0.1,
    };
    let points = points.collect();
    let colours = corners.iter().map(|[a, b, c]| tint((a + b + c) / 3.0)).collect();
    Stage { record: record("data/painted_ball.glb", region, cameras, 6), points, corners, colours }
}

/// The six sides of a box as squares of origin and two edges, whose cross product points inwards or outwards.
fn sides(min: DVec3, max: DVec3, inwards: bool) -> Vec<[DVec3; 3]> {
    let size = max - min;
    let axes = [DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z];
    (0..3)
        .flat_map(|k| {
            let (u, v, w) = (axes[(k + 1) % 3], axes[(k + 2) % 3], axes[k]);
            let (near, far) = ([min, u, v], [min + w, v, u]);
            if inwards { [near, far] } else { [[min, v, u], [min + w, u, v]] }
        })
        .collect()
}

/// A room with furniture, far from the world's origin, and 300 cameras in a box.
pub fn room() -> Stage {
    let at = DVec3::new(400.0, -120.0, 30.0);
    let solid = |low: [f64; 3], high: [f64; 3]| (at + DVec3::from_array(low), at + DVec3::from_array(high));
    let (min, max) = solid([0.0, 0.0, 0.0], [6.0, 4.5, 2.7]);
    let mut squares: Vec<([DVec3; 3], [u8; 3])> =
        sides(min, max, true).into_iter().map(|s| (s, [226, 221, 210])).collect();
    for (low, high, colour) in [
        ([0.1, 1.2, 0.0], [1.0, 3.4, 0.8], [110, 130, 160]),
        ([2.4, 1.7, 0.35], [3.6, 2.7, 0.45], [150, 104, 66]),
        ([4.6, 0.05, 0.0], [5.9, 0.5, 2.0], [124, 84, 60]),
        ([5.2, 3.2, 0.0], [5.9, 4.3, 1.1], [86, 138, 104]),
    ] {
        let (low, high) = solid(low, high);
        squares.extend(sides(low, high, false).into_iter().map(|s| (s, colour)));
    }
    let (low, high) = solid([0.4, 0.4, 0.5], [5.6, 4.1, 2.2]);
    let intrinsics = Intrinsics::from_fov(1600, 1200, 75f64.to_radians());
    let cameras: Vec<Camera> = (0..300)
        .map(|i| {
            let position = low + (high - low) * DVec3::from_array(spread(i));
            let pose = Pose::looking(position, direction(i, 300), DVec3::Z);
            Camera { name: format!("room/{i:04}.jpg"), pose, intrinsics }
        })
        .collect();
    let mut points = Vec::new();
    for ([origin, u, v], colour) in &squares {
        let area = u.cross(*v).length();
        for i in 0..(area * 60.0) as usize {
            let [s, t, _] = spread(i);
            points.push(point(origin + u * s + v * t, u.cross(*v).normalize(), *colour, &cameras));
        }
    }
    let corners = squares.iter().flat_map(|([o, u, v], _)| [[*o, o + u, o + u + v], [*o, o + u + v, o + v]]).collect();
    let colours = squares.iter().flat_map(|(_, colour)| [*colour, *colour]).collect();
    let region = Region { shape: Shape::Box { min: low, max: high }, up: DVec3::Z, floor: None, clearance: 0.15 };
    let mut record = record("scans/living room.ply", region, cameras, 0);
    record.baselines.pop();
    record.status = Status::Interrupted;
    record.history.truncate(640);
    record.checkpoints.truncate(13);
    for checkpoint in &mut record.checkpoints {
        (checkpoint.voronoi_low_vds, checkpoint.voronoi_high_vds) = (None, None);
    }
    Stage { record, points, corners, colours }
}

/// Whether a plot has a line of that name.
fn series(dom: &str, plot: &str, name: &str) -> bool {
    figure(dom, plot).contains(name)
}

const PLOTS: [&str; 7] =
    ["chart-loss", "chart-scale", "chart-coverage", "chart-gap", "chart-voronoi", "chart-views", "chart-gaps"];

/// Opens the page; checks the scripts, every plot, and that a good part of the 3D view is not background.
fn check(name: &str, stage: &Stage) -> Option<String> {
    let dom = rendered(&write(name, &stage.page()), &[])?;
    assert!(dom.contains(r#"data-ready="ok""#), "{name}: a script failed: {}", &dom[..dom.len().min(300)]);
    for plot in PLOTS {
        let values = number_after(figure(&dom, plot), "viewBox", "data-values").unwrap_or(0);
        assert!(values > 0, "{name}: {plot} shows nothing");
    }
    let drawn = number_after(&dom, "<canvas", "data-drawn").expect("the 3D view counts its pixels");
    assert!(drawn > 40_000, "{name}: only {drawn} pixels of the 3D view are not background");
    Some(dom)
}

#[test]
fn the_page_of_an_object_runs_and_draws() {
    let stage = ball();
    if let Some(dom) = check("ball", &stage) {
        assert!(dom.contains("50 views") && dom.contains("44 planned, 6 kept"));
        assert!(series(&dom, "chart-voronoi", "low scores"));
    }
}

#[test]
fn the_page_of_a_room_runs_and_draws() {
    let stage = room();
    if let Some(dom) = check("room", &stage) {
        assert!(dom.contains("INTERRUPTED") && dom.contains("640 iterations"));
        assert!(
            !series(&dom, "chart-voronoi", "low scores"),
            "all scores are equal: there are no thirds to tell apart"
        );
    }
}

/// A COLMAP model or a trained splat has no triangles.
#[test]
fn points_alone_are_drawn() {
    let mut stage = ball();
    (stage.corners, stage.colours) = (Vec::new(), Vec::new());
    check("points", &stage);
}

/// If this failed, a plan that misses half of what is looked at would be shown as if nothing were to be said of it.
#[test]
fn doubts_are_on_the_page() {
    let mut stage = ball();
    assert!(!stage.page().contains("class=\"notice\">") && !stage.page().contains("look before you follow it"));
    stage.record.expected = Some(Expected { db: 1.0, sd: 0.3, unseen: 0.4, against: "rings".into(), reason: None });
    let page = stage.page();
    assert!(page.contains("look before you follow it") && page.contains("seen by no camera (40%)"));
    assert!(!page.contains("heights or ground keep cameras from"));
    stage.record.limits.heights = Some([0.0, 1.0]);
    assert!(stage.page().contains("heights or ground keep cameras from"));
    // A floor is missed where photos say where one can stand; a mesh may have none.
    stage.record.region.floor = None;
    assert!(!stage.page().contains("neither a floor nor a wall"));
    let sees = |camera: &Camera| Sight::new(camera, (0..50).map(|i| direction(i, 50)), &[]);
    let sights: Vec<Sight> = stage.record.cameras.iter().map(sees).collect();
    stage.record.limits.space = Some(KnownSpace::proven(&sights, |_, _| true, None, DVec3::Z).unwrap());
    assert!(stage.page().contains("neither a floor nor a wall limits these cameras"));
}

#[test]
fn without_webgl_the_page_says_so_and_keeps_the_rest() {
    if let Some(dom) = rendered(&write("no_webgl", &ball().page()), &["--disable-3d-apis"]) {
        assert!(dom.contains(r#"data-ready="ok""#), "a script failed");
        assert!(dom.contains(r#"<p class="unavailable">The 3D view needs WebGL 2"#));
        assert!(number_after(figure(&dom, "chart-loss"), "viewBox", "data-values").unwrap_or(0) > 0);
    }
}

/// Without history, baselines, cameras or points there is little to show, but the page must still work.
#[test]
fn an_empty_plan_still_gives_a_page() {
    let mut stage = ball();
    stage.record.history.clear();
    stage.record.checkpoints.clear();
    stage.record.baselines.clear();
    stage.record.cameras.clear();
    stage.record.kept = 0;
    stage.record.metrics.gap_mean_deg = f64::NAN;
    stage.points.clear();
    stage.corners.clear();
    stage.colours.clear();
    if let Some(dom) = rendered(&write("empty", &stage.page()), &[]) {
        assert!(dom.contains(r#"data-ready="ok""#), "a script failed");
        assert_eq!(
            dom.matches("No data: nothing was recorded.").count(),
            PLOTS.len() + 1,
            "once each, and in the script"
        );
    }
}

/// A NaN in the history or the geometry must cost a gap in a line or a grey patch, not the page.
#[test]
fn values_that_are_not_finite_do_not_break_the_page() {
    let mut stage = room();
    stage.record.history[3].loss = f32::NAN;
    stage.record.history[4].image = f32::INFINITY;
    stage.record.checkpoints[2].metrics.gap_mean_deg = f64::NAN;
    stage.points[5].position.x = f64::NAN;
    stage.points[6].score = f32::NAN;
    stage.corners[20][1] = DVec3::NAN;
    check("not_finite", &stage);
}

/// The one address allowed is the name of the SVG namespace, which nothing fetches.
#[test]
fn the_page_refers_to_nothing_outside_itself() {
    for stage in [ball(), room()] {
        let page = stage.page().replace("http://www.w3.org/2000/svg", "");
        for outside in ["http:", "https:", "//cdn", "@import", "url("] {
            assert!(!page.contains(outside), "the page contains {outside}");
        }
    }
}

/// A path or a name is text wherever it lands: in the heading, the summary, the table, the data and the 3D view.
#[test]
fn hostile_strings_stay_text() {
    let evil = "</script><script>document.documentElement.dataset.broken='yes'</script>\"'><img src=x onerror=alert(1)>{{data}}<!--";
    let mut stage = ball();
    stage.record.surface.path = format!("a/{evil}");
    stage.record.surface.kind = evil.into();
    stage.record.device = evil.into();
    stage.record.version = evil.into();
    stage.record.config = serde_json::json!({ evil: evil });
    stage.record.baselines[0].name = evil.into();
    stage.record.cameras[0].name = evil.into();
    let page = stage.page();
    assert!(!page.contains("<img"));
    assert_eq!(page.matches("</script>").count(), 2, "the data and the page's own script, nothing more");
    assert!(!page.contains("<!--") || page.matches("<!--").count() == 1, "the template's one comment");
    if let Some(dom) = check("hostile", &stage) {
        assert!(!dom.contains("data-broken"));
        assert!(!dom.contains("<img"));
    }
}

/// 60,000 triangles and 20,000 points must make a page that can be mailed.
#[test]
fn a_full_page_stays_under_four_megabytes() {
    let mut stage = ball();
    let seed = stage.points.clone();
    stage.points = (0..20_000).map(|i| SurfacePoint { position: direction(i, 20_000), ..seed[i % 6000] }).collect();
    let seed = stage.corners.clone();
    stage.corners = (0..60_000).map(|i| seed[i % seed.len()]).collect();
    stage.colours = vec![[10, 20, 30]; 60_000];
    let size = stage.page().len();
    assert!(size < 4_000_000, "{size} bytes");
}

#[test]
fn colours_must_match_the_triangles() {
    let mut stage = ball();
    stage.colours.pop();
    let triangles = Some(Triangles { corners: &stage.corners, colours: &stage.colours });
    let error =
        html(&stage.record, &ReportScene { points: &stage.points, triangles, cloud: None, worst: &[], shots: None })
            .unwrap_err();
    assert!(error.to_string().contains("colours"));
}
