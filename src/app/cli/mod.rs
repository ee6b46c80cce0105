//! The command line: one file per subcommand, each parses, calls and prints.

/// Prints a line, see [`session::Session::say`].
macro_rules! say {
    ($($text:tt)*) => { $crate::app::cli::session::current().say(format!($($text)*)) };
}

/// Like [`say`], to standard error.
macro_rules! complain {
    ($($text:tt)*) => { $crate::app::cli::session::current().complain(format!($($text)*)) };
}

mod baselines;
mod benchmark;
mod capture;
mod completions;
mod convert;
mod demo;
mod devices;
mod evaluate;
mod evaluation_page;
mod exif_exposure;
mod export;
mod frames;
mod manual;
mod metrics;
mod missions;
mod named;
mod next;
mod options;
mod order;
mod outcome;
mod overwrite_guard;
mod phone;
mod photographed;
mod place;
mod plan;
mod progress;
mod proxy;
mod quality;
mod region;
mod render;
mod retraining;
mod score;
mod select;
mod server;
mod session;
mod shell;
mod subject;
mod train;
mod vds;
mod vdsf;
mod view;
mod viewers;
mod watch;

use std::ffi::OsString;
use std::sync::Arc;

use clap::error::ErrorKind;
use clap::{Arg, CommandFactory, FromArgMatches, Parser, Subcommand};

pub use session::Listener;
use session::{Ended, Session};

use crate::{Error, Result};

/// Version, commit of the source, and hash of the compiled shaders.
const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("CAMSPLAT_BUILD"), ")");

/// Where should the cameras stand?
#[derive(Parser)]
#[command(name = "camsplat", version, long_version = BUILD, about, max_term_width = 110)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Plan camera poses for a surface
    Plan(Box<plan::Arguments>),
    /// Score any camera set on a surface
    Score(Box<score::Arguments>),
    /// Say which photos a capture needs next, and what they would gain
    Next(Box<next::Arguments>),
    /// Score how much each part of a surface changes with the view, from photos
    Vds(vds::Arguments),
    /// Choose frames of a video for structure from motion: sharp, evenly spread, none twice
    Frames(frames::Arguments),
    /// Select the best K photos of a capture
    Select(Box<select::Arguments>),
    /// Compare images with their references: PSNR, SSIM, LPIPS
    Metrics(metrics::Arguments),
    /// Train a Gaussian splatting model on a capture and test it
    Train(Box<train::Arguments>),
    /// Make a coarse surface from posed photos, without any points
    Proxy(proxy::Arguments),
    /// Render trained splats, from any program, at given cameras
    Render(render::Arguments),
    /// Write trained splats in another format: PLY, packed PLY, SPZ, SOG, .splat, glTF
    Convert(convert::Arguments),
    /// Render photos of a glTF scene from given cameras by path tracing
    Capture(Box<capture::Arguments>),
    /// Write cameras for robots (ROS), artists (glTF, Blender, USD) and drones (DJI, QGroundControl, Litchi, KML, GeoJSON)
    Export(export::Arguments),
    /// Compare methods of view selection by the splats trained on their photos
    Evaluate(Box<evaluate::Arguments>),
    /// Compare methods on the benchmark's scenes, and write where each stands
    Benchmark(Box<benchmark::Arguments>),
    /// Show a plan, capture, trained model or folder of runs in the browser
    View(view::Arguments),
    /// Watch a folder while photos arrive in it, and show what they still lack and where to stand next
    Watch(Box<watch::Arguments>),
    /// List every Vulkan device, its features and what it lacks
    Devices,
    /// Run the full pipeline on built-in scenes: plan, render photos, train splats, compare with random placement and a grid
    Demo(demo::Arguments),
    /// The function from variance over photos to view dependency
    Vdsf(vdsf::Arguments),
    /// The law from where views stand to the error of what is trained on them
    Quality(quality::Arguments),
    /// Print completions for a shell
    Completions(completions::Arguments),
    /// Write man pages
    Manual(manual::Arguments),
}

/// What is said where the same command goes on from there.
const STOPPED: &str = "stopped; what is finished stays, and the same command goes on from there";

/// What is said of a standard output that fails.
const NO_ROOM: &str = "error: standard output did not take all that was printed; is its disk full?";

/// How a command ended that ran inside a program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// All that was asked for is written.
    Done,
    /// The listener asked it to stop. What there was is written; `select`, `frames` and `plan --method` leave nothing.
    Stopped,
    /// It failed.
    Failed {
        /// What is wrong, where, and what to do, in one line.
        line: String,
        /// Exit code of the command: 2 for bad input or request, 1 for anything else.
        exit_code: u8,
    },
}

/// Runs a command inside a program: `arguments` are those of the command line, without the program's name. Lines and progress go to the
/// listener, which may stop it as Ctrl-C does. Commands may run on several threads at once.
pub fn run(arguments: impl IntoIterator<Item = OsString>, listener: Arc<dyn Listener>) -> Outcome {
    let arguments = std::iter::once("camsplat".into()).chain(arguments);
    match parse(arguments, Some(listener)) {
        Ok((cli, session)) => match session.within(|| start(cli.command)) {
            Ok(Ended::Done) => Outcome::Done,
            Ok(Ended::Stopped) | Err(Error::Interrupted) => Outcome::Stopped,
            Err(error) => {
                Outcome::Failed { line: session.with_options(error.to_string()), exit_code: error.exit_code() }
            }
        },
        Err((error, session)) if is_answer(&error) => {
            session.say(error.to_string());
            Outcome::Done
        }
        Err((error, _)) => {
            let line = one_line(&error.to_string());
            Outcome::Failed { line: line.trim_start_matches("error: ").to_owned(), exit_code: 2 }
        }
    }
}

/// Runs the command line; `arguments` begin with the program's name. Exit codes: 0 done, 2 bad input or request, 130 stopped by the
/// user (what there was is written; `select`, `frames` and `plan --method` leave nothing), 1 anything else, such as a standard output
/// that takes no more.
pub fn main(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    let (session, code) = match parse(arguments, None) {
        Ok((cli, session)) => {
            let code = match session.within(|| start(cli.command)) {
                Ok(ended) => ended.exit_code(),
                Err(error) => {
                    session.complain(format!("error: {error}"));
                    error.exit_code()
                }
            };
            (session, code)
        }
        Err((error, session)) if is_answer(&error) => {
            session.printed(error.print());
            (session, u8::try_from(error.exit_code()).unwrap_or(2))
        }
        Err((error, session)) => {
            session.complain(one_line(&error.to_string()));
            (session, 2)
        }
    };
    if session.lost_lines() {
        session.complain(NO_ROOM.into());
        return code.max(1);
    }
    code
}

/// Parses a command line, and opens its session.
fn parse(
    arguments: impl IntoIterator<Item = OsString>,
    listener: Option<Arc<dyn Listener>>,
) -> Result<(Cli, Arc<Session>), (clap::Error, Arc<Session>)> {
    let command = command();
    let matches = command.clone().try_get_matches_from(arguments);
    let session = Arc::new(Session::new(listener, &command, matches.as_ref().unwrap_or(&clap::ArgMatches::default())));
    match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
        Ok(cli) => Ok((cli, session)),
        Err(error) => Err((error, session)),
    }
}

/// Whether what the parser has to say is what was asked for, such as the help.
fn is_answer(error: &clap::Error) -> bool {
    use ErrorKind::{DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion};
    matches!(error.kind(), DisplayHelp | DisplayVersion | DisplayHelpOnMissingArgumentOrSubcommand)
}

fn start(command: Command) -> Result<Ended> {
    match command {
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Score(arguments) => score::run(&arguments),
        Command::Next(arguments) => next::run(&arguments),
        Command::Vds(arguments) => vds::run(&arguments),
        Command::Frames(arguments) => frames::run(&arguments),
        Command::Select(arguments) => select::run(&arguments),
        Command::Metrics(arguments) => metrics::run(&arguments),
        Command::Train(arguments) => train::run(&arguments),
        Command::Proxy(arguments) => proxy::run(&arguments),
        Command::Render(arguments) => render::run(&arguments),
        Command::Convert(arguments) => convert::run(&arguments),
        Command::Capture(arguments) => capture::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Benchmark(arguments) => benchmark::run(&arguments),
        Command::View(arguments) => view::run(&arguments),
        Command::Watch(arguments) => watch::run(&arguments),
        Command::Devices => devices::run(),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Vdsf(arguments) => vdsf::run(&arguments),
        Command::Quality(arguments) => quality::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Manual(arguments) => manual::run(&arguments),
    }
}

/// The command line as clap has it: where an option takes a value, `-1` is one, so that what is said of it is that it is too small.
pub fn command() -> clap::Command {
    let with_negatives = |arg: Arg| match arg.get_action().takes_values() {
        true => arg.allow_negative_numbers(true),
        false => arg,
    };
    Cli::command().mut_subcommands(|command| command.mut_args(with_negatives))
}

/// The message of the argument parser without usage, on one line: everything up to its first empty line, and what it takes a misspelt word
/// for.
fn one_line(message: &str) -> String {
    let lines: Vec<&str> = message.lines().map(str::trim).take_while(|line| !line.is_empty()).collect();
    let meant =
        message.lines().find_map(|line| line.trim().strip_prefix("tip: ").filter(|tip| tip.contains("similar")));
    match meant {
        Some(meant) => format!("{}; {meant}", lines.join(" ")),
        None => format!("{}; see --help", lines.join(" ")),
    }
}
