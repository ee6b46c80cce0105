//! The demo at the size of a GPU, whose held-out views are the README's first picture:
//!
//! ```text
//! cargo run --release --example demo_on_gpu -- OUT
//! scripts/first_picture.sh OUT docs/images/first.png
//! ```
//!
//! The first writes `OUT/report.html`; the second needs chromium.

use std::ops::ControlFlow;
use std::path::PathBuf;

use camsplat::app::report;
use camsplat::engine::vulkan::{Context, ContextOptions};
use camsplat::lab::evaluate::demo::{self, DemoEvent, Size};
use camsplat::lab::evaluate::settings::EvaluationSettings;
use camsplat::{Error, Result};

/// Photos of 800 pixels, trained on for a minute.
const SIZE: Size = Size {
    settings: EvaluationSettings {
        size: 800,
        samples: 32,
        test_samples: 64,
        tests: 24,
        iterations: 10_000,
        max_splats: 1_000_000,
        degree: 3,
        ..Size::DEMO.settings
    },
    views: 50,
    seed: 0,
};

fn main() -> Result<()> {
    let out = std::env::args_os().nth(1).map(PathBuf::from);
    let out = out.ok_or_else(|| Error::Request("give the folder to write".into()))?;
    let scene = SIZE.scene("two-rooms")?;
    let context = Context::new(&ContextOptions::default())?;
    let demo = demo::run(&context, &out, SIZE, &scene, &mut |event| {
        if let DemoEvent::Done(step) = event {
            println!("{:<8} {} ({:.1} s)", step.name, step.what, step.seconds);
        }
        ControlFlow::Continue(())
    })?;
    report::demo::write(&demo, &scene, &out)?;
    println!("{}", demo.sentence());
    Ok(())
}
