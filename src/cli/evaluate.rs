//! `camsplat evaluate`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Args;

use super::options::{DeviceOptions, print_messages};
use super::progress::{go_on, stop_on_interrupt};
use crate::evaluate::bench::Event;
use crate::evaluate::job;
use crate::evaluate::request::{Method, Request, Settings, Shown};
use crate::evaluate::subject::Subject;
use crate::evaluate::table;
use crate::io::environment::read_environment;
use crate::io::folder::write_files;
use crate::{Result, report};

/// Arguments of `camsplat evaluate`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Objects with materials and lamps: .glb or .gltf files
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// Folder for the tables and all products. An evaluation that is there goes on, and what it has made stays
    #[arg(long)]
    out: PathBuf,
    /// Light from far around, of all scenes: an equirectangular .hdr file, +Y up
    #[arg(long, value_name = "FILE")]
    env: Option<PathBuf>,
    /// Who chooses: ours, ours-scalar, ours-no-vds, ours-iterative, or a --method of `camsplat plan` [default: random,
    /// fibonacci, fvs, acp, fisherrf, fisherrf-retrain, cover, manifold, ours-iterative, ours-no-vds, ours-scalar, ours;
    /// quick: random, fvs, ours]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    methods: Option<Vec<Method>>,
    /// How many views are chosen [default: 50,100; quick: 20]
    #[arg(long, value_delimiter = ',', value_name = "NUMBERS")]
    budgets: Option<Vec<u32>>,
    /// Runs of each, for the intervals
    #[arg(long, default_value_t = 3)]
    seeds: u32,
    /// Small pictures and short training: minutes on two cores
    #[arg(long)]
    quick: bool,
    /// What methods are shown of a scene
    #[arg(long, value_enum, default_value_t = Shown::Proxy)]
    surface: Shown,
    /// Side of the pictures in pixels [default: 800; quick: 96]
    #[arg(long, value_name = "PIXELS")]
    size: Option<u32>,
    /// Samples of a pixel [default: 256; quick: 8]
    #[arg(long)]
    spp: Option<u32>,
    /// Photos that the surface and its scores are made from, of no part in the training
    #[arg(long, default_value_t = 10)]
    inputs: u32,
    /// Test views of each of three sets [default: 200; quick: 12]
    #[arg(long)]
    tests: Option<u32>,
    /// Iterations of training [default: 30000; quick: 300]
    #[arg(long)]
    iterations: Option<u32>,
    /// Most splats [default: 1000000; quick: 5000]
    #[arg(long)]
    max_splats: Option<u32>,
    #[command(flatten)]
    device: DeviceOptions,
}

/// Methods where none are named.
const USUAL: [&str; 12] = [
    "random",
    "fibonacci",
    "fvs",
    "acp",
    "fisherrf",
    "fisherrf-retrain",
    "cover",
    "manifold",
    "ours-iterative",
    "ours-no-vds",
    "ours-scalar",
    "ours",
];
const QUICK: [&str; 3] = ["random", "fvs", "ours"];

impl Arguments {
    fn request(&self) -> Request {
        let usual: &[&str] = if self.quick { &QUICK } else { &USUAL };
        let named = || usual.iter().filter_map(|name| name.parse().ok()).collect();
        let of = if self.quick { Settings::QUICK } else { Settings::WHOLE };
        Request {
            methods: self.methods.clone().unwrap_or_else(named),
            budgets: self.budgets.clone().unwrap_or_else(|| if self.quick { vec![20] } else { vec![50, 100] }),
            seeds: self.seeds,
            settings: Settings {
                size: self.size.unwrap_or(of.size),
                samples: self.spp.unwrap_or(of.samples),
                inputs: self.inputs,
                tests: self.tests.unwrap_or(of.tests),
                iterations: self.iterations.unwrap_or(of.iterations),
                max_splats: self.max_splats.unwrap_or(of.max_splats),
                shown: self.surface,
            },
        }
    }
}

/// Evaluates, writes and prints the tables.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let request = arguments.request();
    request.validate()?;
    let mut notes = Vec::new();
    let environment = arguments.env.as_deref().map(|path| read_environment(path, &mut notes)).transpose()?;
    let mut subjects = Vec::new();
    for path in &arguments.scenes {
        subjects.push(Subject::read(path, environment.as_ref(), &request.settings.intrinsics(), &mut notes)?);
    }
    job::check(&arguments.out, &subjects)?;
    for note in &notes {
        say!("{note}");
    }
    let context = arguments.device.open()?;
    say!("device   {} ({})", context.physical().name, context.physical().driver.trim());
    stop_on_interrupt()?;
    let start = Instant::now();
    let (mut made, mut kept) = (0, 0);
    let outcome = job::run(&context, &request, subjects, &arguments.out, &mut |event| {
        match event {
            Event::Begins(product) => {
                made += 1;
                say!("making   {product}, after {:.0} s", start.elapsed().as_secs_f64());
            }
            Event::Kept(_) => kept += 1,
            Event::Working => {}
        }
        go_on()
    });
    print_messages(&context);
    let Some(outcome) = outcome? else {
        say!("stopped; what is finished stays, and the same command goes on from there");
        return Ok(ExitCode::from(super::INTERRUPTED));
    };
    let page = arguments.out.join("report.html");
    write_files(&[(&page, report::evaluation::html(&outcome).as_bytes())])?;
    say!("products {made} made, {kept} kept, in {:.0} s", start.elapsed().as_secs_f64());
    say!("{}", table::markdown(&request, &outcome.rows).trim_end());
    say!("written  {}, {}", arguments.out.join("table.md").display(), page.display());
    Ok(ExitCode::SUCCESS)
}
