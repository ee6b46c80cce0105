//! The whole demo pipeline, from photographs of its own scene to scores and the page, and what a stop leaves.

use std::ops::ControlFlow;

use crate::support::command::{Place, assert_refused, read_until, stop};
use camsplat::app::report;
use camsplat::engine::vulkan::{Context, ContextOptions};
use camsplat::lab::evaluate::demo::{self, DemoEvent, Size};
use camsplat::lab::evaluate::scene::Scene;
use camsplat::lab::evaluate::settings::EvaluationSettings;

/// A demo of seconds.
const SMALL: Size = Size {
    settings: EvaluationSettings {
        size: 48,
        samples: 2,
        test_samples: 2,
        tests: 5,
        iterations: 20,
        max_splats: 500,
        ..Size::DEMO.settings
    },
    // With fewer, the plan is the grid at eye height, whose photographs would then be there already.
    views: 8,
    seed: 3,
};

fn subject() -> Scene {
    SMALL.scene("rooms").unwrap()
}

/// If this failed, the demo would end without scores, with a page whose pictures and links lead nowhere, or start over after a
/// stop.
#[test]
fn the_whole_way_is_gone_and_the_page_shows_what_is_there() {
    let context = Context::new(&ContextOptions { validation: true, ..ContextOptions::default() }).unwrap();
    let place = Place::new();
    let out = place.path("out");
    let (mut told, mut stopping) = (Vec::new(), false);
    let broken_off = demo::run(&context, &out, SMALL, &subject(), &mut |event| {
        if let DemoEvent::Done(step) = event {
            stopping = step.name == "tests";
            told.push(step.name);
        }
        if stopping { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(broken_off, Err(camsplat::Error::Interrupted)));
    assert_eq!(told, ["light", "plan", "tests"]);

    let demo = demo::run(&context, &out, SMALL, &subject(), &mut |_| ControlFlow::Continue(())).unwrap();
    let kept = |name: &str| demo.steps.iter().any(|step| step.name == name && step.what.contains("earlier run"));
    assert!(kept("light") && kept("tests") && !kept("photos") && !kept("training"), "{:?}", demo.steps);
    let methods: Vec<&str> = demo.outcome.rows.iter().map(|row| row.method.name()).collect();
    assert_eq!(methods, ["ours", "random", "grid"]);
    let sentence = demo.sentence();
    assert!(sentence.contains("8 photos from planned places") && sentence.matches(" dB").count() == 3, "{sentence}");
    // LPIPS of VGG16 was not requested.
    for interval in demo.outcome.rows.iter().flat_map(|row| row.measured[..3].iter().flatten()) {
        assert!(interval.is_some_and(|interval| interval.mean.is_finite()), "{:?}", demo.outcome.rows);
    }

    report::demo::write(&demo, &subject(), &out).unwrap();
    let page = place.read("out/report.html");
    let named =
        |attribute: &str| page.split(attribute).skip(1).filter_map(|rest| rest.split('"').next()).collect::<Vec<_>>();
    let (pictures, mut links) = (named("src=\""), named("href=\""));
    links.retain(|link| !link.starts_with("data:"));
    // Photos of three methods; of three test views the photo, and what each method shows of it beside its difference to the photo.
    assert_eq!((pictures.len(), &links[..]), (3 * 8 + 3 * (1 + 3 * 3), &["rooms/plan/report.html"][..]));
    assert!(page.contains(&sentence));
    for file in pictures.iter().chain(&links) {
        assert!(out.join(file).is_file(), "{file} is not there");
    }
    assert_eq!(context.messages(), [""; 0]);
}

/// If this failed, Ctrl-C would end the demo as if it were done, or as if it had failed.
#[test]
fn a_stopped_demo_says_so() {
    let place = Place::new();
    let mut child = place.command("demo --out o").spawn().unwrap();
    let output = read_until(&mut child, "Where should the cameras stand?");
    let stopped = stop(child, output, "-INT");
    assert_eq!(stopped.code, Some(130), "{}{}", stopped.out, stopped.err);
    assert!(stopped.out.contains("the same command goes on"), "{}", stopped.out);
    assert!(!place.path("o/report.html").exists());
}

/// If this failed, the demo would overwrite a user's files.
#[test]
fn a_demo_does_not_write_into_a_folder_of_others() {
    let place = Place::new();
    std::fs::create_dir_all(place.path("mine/object")).unwrap();
    place.write("mine/object/plan.json", "mine");
    assert_refused(&place, &[("demo --out mine", &["mine", "holds no demo", "--out"])]);
    assert_eq!(place.read("mine/object/plan.json"), "mine");
}
