//! The page of a training run, opened in a real browser where there is one: scripts must run, plots must hold data, and
//! the numbers must be those of the record.

use crate::support::browser::{acting, figure, number_after, rendered, write};
use camsplat::app::report::training::{Comparison, Model, Shown, html};
use camsplat::scene::camera::{Camera, Intrinsics, Pose};
use camsplat::scene::gaussians::Gaussians;
use camsplat::splats::config::TrainConfig;
use camsplat::splats::run::record::{
    CurvePoint, Evaluation, MemoryRecord, PhotosRecord, Quality, StageTime, Status, TestView, TrainRecord,
};
use glam::DVec3;

const PLOTS: [&str; 4] = ["chart-loss", "chart-psnr", "chart-splats", "chart-instances"];

/// Even in [-1, 1], and the same on every run.
fn noise(i: u32) -> f64 {
    2.0 * (0.819_172_513 * (f64::from(i) + 0.5)).fract() - 1.0
}

/// A run of 30,000 iterations that is done with so many of them.
fn run(iterations: u32, status: Status) -> TrainRecord {
    let progress = |i: u32| 1.0 - (-f64::from(i) / 4000.0).exp();
    let quality = |i: u32| Quality {
        psnr: 17.0 + 10.4 * progress(i),
        ssim: 0.45 + 0.37 * progress(i),
        lpips: Some(0.55 - 0.38 * progress(i)),
        lpips_vgg: None,
    };
    let curve = (1..=iterations / 100).map(|k| {
        let splats = (138_766.0 * 1.05f64.powi(k as i32 - 5).max(1.0)).min(1e6) as u32;
        CurvePoint {
            iteration: 100 * k,
            loss: 0.32 * (1.0 - 0.86 * progress(100 * k)) * (1.0 + 0.06 * noise(k)),
            psnr: 16.5 + 12.3 * progress(100 * k) + 0.3 * noise(7 * k),
            splats,
            instances: 4.1 * f64::from(splats) * (1.0 + 0.04 * noise(3 * k)),
        }
    });
    let evaluations = [1000, 3000, 7000, 15_000, 30_000].into_iter().filter(|at| *at <= iterations);
    let evaluations =
        evaluations.map(|iteration| Evaluation { iteration, views: 24, quality: quality(iteration) }).collect();
    let view = |i: u32| TestView {
        name: format!("DSC{:05}.JPG", 7956 + 8 * (i * 7 % 24)),
        quality: Quality {
            psnr: 22.31 + 0.4 * f64::from(i),
            ssim: 0.7012 + 0.008 * f64::from(i),
            lpips: Some(0.31 - 0.009 * f64::from(i)),
            lpips_vgg: None,
        },
    };
    let stages = "splat_backward 1.214|splat_forward 0.871|radix_sort 0.655|splat_update 0.602|ssim_backward 0.214|\
        ssim_forward 0.187|splat_project 0.163|tile_emit 0.141|tile_ranges 0.052|tile_scan 0.047|instance_gather 0.044|\
        photo_copy 0.031|mcmc_relocate 0.019|mcmc_noise 0.012|view_setup 0.004|ledger 0.003";
    let stages = stages.split('|').map(|stage| {
        let (name, ms) = stage.split_once(' ').unwrap();
        StageTime { name: name.into(), ms: ms.parse().unwrap() }
    });
    let mib = |name: &str, size: u64| (name.to_owned(), size << 20);
    let buffers: Vec<_> = [("parameters", 225), ("first", 225), ("second", 225), ("photos", 690), ("instances", 192)]
        .into_iter()
        .chain([("sort_scratch", 128), ("checkpoints", 96), ("picture", 15), ("ssim_maps", 90), ("projected", 61)])
        .chain([("gradients", 58), ("counts", 4), ("tile_ranges", 1), ("history", 1)])
        .map(|(name, size)| mib(name, size))
        .collect();
    TrainRecord {
        version: "0.1.0".into(),
        status,
        device: "NVIDIA H200, driver 580.65".into(),
        photos: PhotosRecord {
            capture: "captures/garden/sparse/0".into(),
            train: 161,
            test: 24,
            largest: [1297, 840],
            shrink: 4,
            points: 138_766,
            extent: 4.812_37,
        },
        config: TrainConfig { seed: 7, ..TrainConfig::new(30_000, 1_000_000) },
        iterations,
        splats: if iterations > 5000 { 1_000_000 } else { 138_766 },
        seconds: f64::from(iterations) / 214.0,
        seconds_for: iterations,
        gpu_seconds: None,
        curve: curve.collect(),
        evaluations,
        test_views: (0..24).map(view).collect(),
        exposures: Vec::new(),
        poses: Vec::new(),
        stages: stages.collect(),
        memory: MemoryRecord { announced: buffers.iter().map(|(_, size)| size).sum(), peak: 2_034 << 20, buffers },
    }
}

/// A run that has only just begun.
fn fresh() -> TrainRecord {
    TrainRecord {
        iterations: 0,
        seconds: 0.0,
        seconds_for: 0,
        curve: Vec::new(),
        evaluations: Vec::new(),
        test_views: Vec::new(),
        exposures: Vec::new(),
        poses: Vec::new(),
        stages: Vec::new(),
        memory: MemoryRecord::default(),
        ..run(0, Status::Running)
    }
}

/// A landscape with as much grain as a photo has, and a run's rendering of it: softer, and with a haze in the air.
fn pictures(width: u32, height: u32, seed: u32) -> [Vec<u8>; 2] {
    let pixel = |x: u32, y: u32, grain: f64, haze: f64| {
        let (u, v) = (f64::from(x) / f64::from(width), f64::from(y) / f64::from(height));
        let hill = 0.45 + 0.12 * (5.0 * u + f64::from(seed)).sin() + 0.04 * (17.0 * u).sin();
        let base = if v < hill { [120.0, 160.0 + 60.0 * v, 215.0] } else { [96.0 - 40.0 * v, 128.0 - 30.0 * v, 52.0] };
        let grain = grain * noise(x.wrapping_mul(1973) ^ y.wrapping_mul(9277) ^ seed);
        let haze = haze * (-40.0 * ((u - 0.6).powi(2) + (v - 0.3).powi(2))).exp();
        base.map(|c| (c + grain + haze) as u8)
    };
    [(4.0, 60.0), (24.0, 0.0)]
        .map(|(grain, haze)| (0..width * height).flat_map(|i| pixel(i % width, i / width, grain, haze)).collect())
}

/// The page with comparisons of the worst test views.
fn page_with(record: &TrainRecord, views: usize) -> String {
    let pairs: Vec<_> = (0..views as u32).map(|i| pictures(800, 800, i)).collect();
    let worst: Vec<_> = pairs
        .iter()
        .zip(&record.test_views)
        .map(|([rendered, reference], view)| Comparison {
            name: &view.name,
            width: 800,
            height: 800,
            rendered,
            reference,
        })
        .collect();
    html(record, &Shown::new(record, &worst).unwrap(), None).unwrap()
}

/// Opens the page; its scripts must have run.
fn opened(name: &str, page: &str) -> Option<String> {
    let dom = rendered(&write(&format!("training_{name}"), page), &[])?;
    assert!(dom.contains(r#"data-ready="ok""#), "{name}: a script failed: {}", &dom[..dom.len().min(300)]);
    Some(dom)
}

fn draws(dom: &str, plot: &str) -> bool {
    number_after(figure(dom, plot), "viewBox", "data-values").unwrap_or(0) > 0
}

/// A number that is not the record's, or one that is left out, would describe another run.
#[test]
fn the_page_tells_the_numbers_of_the_record() {
    let record = run(30_000, Status::Complete);
    let page = page_with(&record, 8);
    let last = record.evaluations.last().unwrap().quality;
    let worst = record.test_views[0].quality;
    let expected = [
        "<h1>garden <span class=\"badge\">complete</span></h1>".into(),
        "1\u{202f}000\u{202f}000 splats after 30\u{202f}000 iterations".into(),
        format!("<strong>{:.2} dB</strong><span>24 test views after 30\u{202f}000</span>", last.psnr),
        format!("<strong>{:.4}</strong>", last.ssim),
        format!("<strong>{:.4}</strong>", last.lpips.unwrap()),
        "<strong>214</strong><span>iterations a second</span>".into(),
        "<strong>2 min 20 s</strong>".into(),
        "<strong>1.99 GiB</strong>".into(),
        format!("PSNR {:.2} dB</span><span>SSIM {:.4}</span>", worst.psnr, worst.ssim),
        // 4.259 ms of stages beside 1000 / 214 ms of wall clock.
        "4.259 ms in all. The GPU alone would make 234.8 iterations a second; the run makes 214: 0.414 ms of 4.673 ms, 8.9 %".into(),
        "<td>1.214 ms</td><td>28.5 %</td>".into(),
        "4 others".into(),
        "every 100 iterations, from 500 to 25\u{202f}000".into(),
        "161 to train on, 24 to test with".into(),
        "1297 × 840 pixels, shrunk 4 times".into(),
        "camsplat 0.1.0".into(),
    ];
    for text in expected {
        assert!(page.contains(&text), "the page lacks {text}");
    }
    for view in &record.test_views {
        assert!(page.contains(&format!("{}</th><td>{:.2}</td>", view.name, view.quality.psnr)));
    }
    assert_eq!(page.matches("data:image/jpeg").count(), 24);
    if let Some(dom) = opened("complete", &page) {
        for plot in PLOTS {
            assert!(draws(&dom, plot), "{plot} shows nothing");
        }
        assert_eq!(figure(&dom, "chart-psnr").matches("class=\"mark\"").count(), record.evaluations.len());
    }
}

/// A ball of coloured Gaussians far from the origin.
fn ball(count: usize) -> Gaussians {
    let turn = |i: usize| i as f64 * 2.399_963_229_728_653;
    let centre = |i: usize| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / count as f64;
        DVec3::new(500.0, -20.0, 3.0)
            + (DVec3::new(turn(i).cos(), turn(i).sin(), 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z)
    };
    // Red towards +X, green towards +Y.
    let colour = |i: usize| (0..3).map(move |c| 1.5 * (centre(i) - DVec3::new(500.0, -20.0, 3.0))[c] as f32);
    Gaussians {
        centres: (0..count).map(centre).collect(),
        log_scales: vec![[-3.0, -3.0, -4.0]; count],
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
        opacities: vec![2.0; count],
        degree: 0,
        harmonics: (0..count).flat_map(colour).collect(),
        antialiased: false,
    }
}

/// Cameras around the ball.
fn around(names: &[&str]) -> Vec<Camera> {
    let camera = |(i, name): (usize, &&str)| {
        let angle = 1.3 * i as f64;
        let back = DVec3::new(angle.cos(), angle.sin(), 0.3).normalize();
        Camera {
            name: (*name).into(),
            pose: Pose::looking(DVec3::new(500.0, -20.0, 3.0) + 4.0 * back, -back, DVec3::Z),
            intrinsics: Intrinsics::from_fov(400, 300, 0.8),
        }
    };
    names.iter().enumerate().map(camera).collect()
}

/// If this failed, the page would show no splats, the same from everywhere, or not from where the photos beside them were taken.
#[test]
fn trained_splats_are_seen_from_test_views() {
    let mut record = run(30_000, Status::Complete);
    record.photos.extent = 4.0;
    let tests: Vec<&str> = record.test_views[..2].iter().map(|view| view.name.as_str()).collect();
    let model = Model::new(&ball(4000), &around(&["a.jpg", "b.jpg"]), &around(&["c.jpg", tests[1], tests[0]]));
    let [rendered_view, photo] = pictures(400, 300, 1);
    let worst = Comparison { name: tests[0], width: 400, height: 300, rendered: &rendered_view, reference: &photo };
    let page = html(&record, &Shown::new(&record, &[worst]).unwrap(), Some(&model)).unwrap();
    let script = r#"
        const form = document.querySelector(".scene form"), canvas = document.querySelector("canvas");
        const name = () => form.camera.selectedOptions[0].textContent, seen = [[name(), pixels(canvas)]];
        const actions = [() => form.next.click(), () => { form.photo.value = 1; form.next.click(); }, () => form.previous.click(), () => {
            canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: -300 }));
        }];
        const next = () => {
            if (actions.length === 0) {
                document.body.dataset.names = seen.map(([name]) => name).join("; ");
                document.body.dataset.different = new Set(seen.map(([, shown]) => shown)).size;
                return;
            }
            actions.shift()();
            setTimeout(() => {
                seen.push([name(), pixels(canvas)]);
                if (document.querySelector(".frame:not([hidden]) img")) document.body.dataset.photo = name();
                next();
            }, 50);
        };
        next();"#;
    if let Some(dom) = opened("splats", &acting(&page, script)) {
        let drawn = number_after(&dom, "<canvas", "data-drawn").expect("the 3D view counts its pixels");
        assert!(drawn > 20_000, "only {drawn} pixels are not background");
        assert!(dom.contains("All 4\u{202f}000 splats are shown."));
        // The worst test view first; one that was not tested has no metrics.
        let (worst, second) = (format!("{} (test, 22.31 dB)", tests[0]), format!("{} (test, 22.71 dB)", tests[1]));
        let expected = format!("data-names=\"a.jpg (training); {worst}; {second}; {worst}; none\"");
        assert!(dom.contains(&expected), "{expected} is not {:?}", dom.split("data-names=").nth(1).map(|d| &d[..160]));
        assert!(dom.contains("data-different=\"4\""), "{:?}", dom.split("data-different=").nth(1).map(|d| &d[..8]));
        assert!(dom.contains(&format!("data-photo=\"{worst}\"")), "its photo is not over it");
    }
    let dom = rendered(&write("training_no_webgl", &page), &["--disable-3d-apis"]);
    if let Some(dom) = dom {
        assert!(dom.contains(r#"<p class="unavailable">The 3D view needs WebGL 2"#) && draws(&dom, "chart-loss"));
    }
}

/// Lines and points have iterations of their own: under the pointer, each must show the nearest value.
#[test]
fn the_pointer_reads_lines_and_points() {
    let record = run(30_000, Status::Complete);
    let act = r##"<script>setTimeout(() => {
        const svg = document.querySelector("#chart-psnr > svg"), box = svg.querySelectorAll(".mark")[2].getBoundingClientRect();
        svg.dispatchEvent(new PointerEvent("pointermove", { clientX: box.left + box.width / 2 }));
        document.body.dataset.read = document.querySelector("#chart-psnr .keys").textContent;
    }, 200);</script></body>"##;
    let page = html(&record, &Shown::default(), None).unwrap().replace("</body>", act);
    if let Some(dom) = opened("pointer", &page) {
        let (test, training) = (record.evaluations[2].quality.psnr, record.curve[69].psnr);
        let expected = format!("data-read=\"test {test:.2} at 7000training {training:.2}at 7000\"");
        assert!(
            dom.contains(&expected),
            "{expected} is not what {:?} reads",
            dom.split("data-read=").nth(1).map(|d| &d[..60])
        );
    }
}

/// Without the reload a user would watch a page that never changes; with it a finished page would flicker for ever.
#[test]
fn only_the_page_of_a_running_run_reloads_itself() {
    let reload = r#"<meta http-equiv="refresh" content="30">"#;
    let running = page_with(&run(12_400, Status::Running), 3);
    assert!(running.contains(reload) && running.contains("reloads itself every 30 s"));
    assert!(running.contains("<title>41 % of garden</title>"));
    assert!(running.contains("Time left</span><strong>1 min 22 s</strong>"));
    opened("running", &running);
    let stopped = page_with(&run(12_400, Status::Interrupted), 3);
    assert!(stopped.contains("stopped after 12\u{202f}400 of 30\u{202f}000 iterations"));
    opened("stopped", &stopped);
    for page in [stopped, page_with(&run(30_000, Status::Complete), 0)] {
        assert!(!page.contains("http-equiv=\"refresh\"") && !page.contains("reloads itself"));
    }
}

/// The first page is written before there is anything to show.
#[test]
fn a_run_that_has_just_begun_has_a_page() {
    let page = html(&fresh(), &Shown::default(), None).unwrap();
    for text in ["No test view was rendered yet", "No stage was timed yet", "not measured yet", "0.0 % of 30"] {
        assert!(page.contains(text), "the page lacks {text}");
    }
    for text in ["NaN", "inf"] {
        assert!(!page.split("<script").next().unwrap().contains(&format!(">{text}")), "the page says {text}");
    }
    if let Some(dom) = opened("fresh", &page) {
        for plot in PLOTS {
            assert!(!draws(&dom, plot) && figure(&dom, plot).contains("nothing was recorded"));
        }
    }
}

/// Equal pictures have an infinite PSNR, and a broken run no loss: a gap in a line, not the end of the page.
#[test]
fn values_that_are_not_finite_do_not_break_the_page() {
    let mut record = run(15_000, Status::Complete);
    record.curve[3].loss = f64::NAN;
    record.curve[4].psnr = f64::INFINITY;
    record.curve[5].instances = f64::NAN;
    record.evaluations[3].quality = Quality { psnr: f64::INFINITY, ssim: f64::NAN, ..Quality::default() };
    record.test_views[0].quality.psnr = f64::INFINITY;
    record.stages[0].ms = f64::NAN;
    record.seconds = f64::NAN;
    record.photos.extent = f64::NAN;
    let page = page_with(&record, 1);
    assert!(page.contains("<strong>∞ dB</strong>") && page.contains("PSNR ∞ dB"));
    assert!(page.contains("<strong>–</strong><span>not measured</span>"));
    if let Some(dom) = opened("not_finite", &page) {
        for plot in PLOTS {
            assert!(draws(&dom, plot), "{plot} shows nothing");
        }
    }
}

/// If this failed, a model that diverged would look like a good one on its page, one that was stopped would be reported as
/// diverged, or a photo that is rendered exactly would make the record unreadable.
#[test]
fn a_training_that_diverged_says_so() {
    let warns = |record: &TrainRecord| page_with(record, 1).contains("Warning: training diverged");
    let mut record = run(30_000, Status::Complete);
    assert!(!warns(&record));
    record.curve[200..].iter_mut().for_each(|point| point.psnr = 15.0);
    record.curve[4].psnr = f64::INFINITY;
    assert!(
        warns(&record)
            && page_with(&record, 1).contains("dB; retry with another seed")
            && page_with(&record, 1).contains("to 15.0 dB")
    );
    let stopped = TrainRecord { status: Status::Interrupted, ..record.clone() };
    let short =
        |iterations| TrainRecord { config: TrainConfig { iterations, ..record.config.clone() }, ..record.clone() };
    assert_eq!([stopped, short(999), short(1000)].map(|record| warns(&record)), [false, false, true]);
    let text = serde_json::to_string(&record).unwrap();
    assert_eq!(serde_json::from_str::<TrainRecord>(&text).unwrap(), record);
}

/// A model that fell and rose again is judged by its fall, not by its end. If this failed, whoever trained it would be told nothing, a PSNR
/// that its curve contradicts, or to train for longer what relocation spoils.
#[test]
fn a_training_that_fell_and_recovered_says_both_and_is_not_called_too_short() {
    let mut record = run(30_000, Status::Complete);
    for (i, point) in record.curve.iter_mut().enumerate() {
        point.psnr = if (100..240).contains(&i) { 15.0 } else { 20.0 + i as f64 / 50.0 };
    }
    let page = page_with(&record, 1);
    assert!(
        page.contains("fell from 21.8 to 15.0 dB before it rose to 25.8; retry with another seed"),
        "{:?}",
        record.diverged_line()
    );
    assert!(!page.contains("training was too short"), "{:?}", record.short_line());
}

/// If this failed, whoever overfits a model would be told to train it for longer.
#[test]
fn a_training_that_overfits_is_called_too_long_and_not_too_short() {
    let mut record = run(30_000, Status::Complete);
    for (i, point) in record.curve.iter_mut().enumerate() {
        point.psnr = 20.0 + 0.02 * i as f64;
    }
    let warns =
        |record: &TrainRecord, what: &str| page_with(record, 1).contains(&format!("Warning: training was {what}"));
    assert!(warns(&record, "too short") && !warns(&record, "too long"));
    let tests = [21.0, 23.8, 23.7, 23.0, 22.8];
    for (evaluation, psnr) in record.evaluations.iter_mut().zip(tests) {
        evaluation.quality.psnr = psnr;
    }
    assert!(warns(&record, "too long") && !warns(&record, "too short"));
    let line = record.overfitted_line().unwrap();
    assert!(line.contains("fell from 23.8 dB after 3000 iterations to 22.8"), "{line}");
    // At the end there are more views, harder ones: only those on the way are compared.
    record.evaluations[4].views = 200;
    record.evaluations[4].quality.psnr = 18.0;
    assert!(record.overfitted_line().is_some_and(|line| line.contains("to 23.0")));
    record.evaluations[3].quality.psnr = 23.7;
    assert_eq!(record.overfitted_line(), None);
}

/// A path or a name is text wherever it lands: in headings, tables, bars, and the attributes of pictures.
#[test]
fn hostile_strings_stay_text() {
    let evil = "</script><script>document.documentElement.dataset.broken='yes'</script>\"'><img src=x onerror=alert(1)>{{data}}<!--";
    let mut record = run(12_400, Status::Running);
    record.photos.capture = format!("a/{evil}");
    record.device = evil.into();
    record.version = evil.into();
    record.test_views[0].name = evil.into();
    record.stages[0].name = evil.into();
    record.memory.buffers[0].0 = evil.into();
    let page = page_with(&record, 1);
    assert_eq!(page.matches("</script>").count(), 2, "the data and the page's own script, nothing more");
    assert_eq!(page.matches("<!--").count(), 1, "the template's one comment");
    assert_eq!(page.matches("<img").count(), 3, "the pictures, nothing more");
    assert!(page.contains("{{data}}"), "a slot in a name is text too");
    if let Some(dom) = opened("hostile", &page) {
        assert!(!dom.contains("data-broken"));
    }
}

/// The one address allowed is the name of the SVG namespace, which nothing fetches.
#[test]
fn the_page_refers_to_nothing_outside_itself() {
    let page = html(&run(30_000, Status::Complete), &Shown::default(), None)
        .unwrap()
        .replace("http://www.w3.org/2000/svg", "");
    for outside in ["http:", "https:", "//cdn", "@import", "url("] {
        assert!(!page.contains(outside), "the page contains {outside}");
    }
}

/// If this failed, the page of a large model would be too large to be opened.
#[test]
fn a_page_with_a_large_model_stays_under_eight_megabytes() {
    let record = run(30_000, Status::Complete);
    let model = Model::new(&ball(200_000), &around(&["a.jpg"]), &[]);
    let pictures = page_with(&record, 8).len();
    let size = pictures + html(&record, &Shown::default(), Some(&model)).unwrap().len();
    assert!(size < 8_000_000, "{size} bytes");
}

/// Eight grainy views must make a page that can be mailed.
#[test]
fn a_full_page_stays_under_four_megabytes() {
    let size = page_with(&run(30_000, Status::Complete), 8).len();
    assert!(size < 4_000_000, "{size} bytes");
}
