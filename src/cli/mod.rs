//! The command line: one file per subcommand, each parses, calls and prints.

/// Prints a line. Who reads it may be gone (`camsplat plan ... | head -1`); that is no reason to lose a plan, so what
/// cannot be printed is not; for any other reason (a full disk) the exit code tells, see [`main`].
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        if let Err(error) = writeln!(std::io::stdout(), "{}", $crate::cli::with_options(format!($($text)*))) {
            $crate::cli::unsaid(&error);
        }
    }};
}

/// Like [`say`], to standard error.
macro_rules! complain {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), "{}", $crate::cli::with_options(format!($($text)*)));
    }};
}

mod baselines;
mod capture;
mod completions;
mod demo;
mod devices;
mod evaluate;
mod export;
mod frames;
mod manual;
mod metrics;
mod options;
mod order;
mod outcome;
mod place;
mod plan;
mod progress;
mod proxy;
mod quality;
mod render;
mod retraining;
mod score;
mod select;
mod train;
mod vds;
mod vdsf;
mod viewers;

use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use clap::error::ErrorKind;
use clap::{Arg, CommandFactory, FromArgMatches, Parser, Subcommand};

/// Where should the cameras stand?
#[derive(Parser)]
#[command(name = "camsplat", version, about, max_term_width = 110)]
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
    /// Render photos of a glTF scene from given cameras by path tracing
    Capture(Box<capture::Arguments>),
    /// Write cameras for robots (ROS), artists (glTF, Blender, USD) and drones (DJI, QGroundControl, Litchi, KML, GeoJSON)
    Export(export::Arguments),
    /// Compare methods of view selection by the splats trained on their photos
    Evaluate(Box<evaluate::Arguments>),
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

/// Exit code of a run that the user stopped: 128 + SIGINT, as shells have it.
const INTERRUPTED: u8 = 130;
/// What is said where the same command goes on from there.
const STOPPED: &str = "stopped; what is finished stays, and the same command goes on from there";

/// What is said of a standard output that fails.
const NO_ROOM: &str = "error: standard output did not take all that was printed; is its disk full?";

/// Whether something could not be printed though there is still a reader.
static UNSAID: AtomicBool = AtomicBool::new(false);

/// Names of the command's arguments as the library has them, each with its option.
static OPTIONS: OnceLock<Vec<(String, String)>> = OnceLock::new();

/// What the library says, with the command's options in place of settings: `` `held_out` `` is `--held-out`.
fn with_options(text: String) -> String {
    if !text.contains('`') {
        return text;
    }
    let put = |text: String, (setting, option): &(String, String)| text.replace(setting, option);
    OPTIONS.get().into_iter().flatten().fold(text, put)
}

/// The options of the command that the arguments name, see [`with_options`].
fn options_of(command: &clap::Command, matches: &clap::ArgMatches) -> Vec<(String, String)> {
    if let Some((name, matches)) = matches.subcommand() {
        return command.find_subcommand(name).map_or_else(Vec::new, |subcommand| options_of(subcommand, matches));
    }
    // A field that would be a keyword ends in an underscore.
    let setting = |arg: &Arg| format!("`{}`", arg.get_id().as_str().trim_end_matches('_'));
    let named = |arg: &Arg| arg.get_long().map(|long| (setting(arg), format!("--{long}")));
    command.get_arguments().filter_map(named).collect()
}

/// What [`say`] does where it cannot print.
fn unsaid(error: &std::io::Error) {
    if error.kind() != std::io::ErrorKind::BrokenPipe {
        UNSAID.store(true, Ordering::Relaxed);
    }
}

/// Runs the command line. Exit codes: 0 done, 2 bad input or request, 130 stopped by the user (what there was is
/// written; `select`, `frames` and `plan --method` leave nothing), 1 anything else, such as a standard output that takes no more.
pub fn main() -> ExitCode {
    let command = command();
    let parse = |matches: clap::ArgMatches| {
        OPTIONS.get_or_init(|| options_of(&command, &matches));
        Cli::from_arg_matches(&matches)
    };
    let cli = match command.clone().try_get_matches().and_then(parse) {
        Ok(cli) => cli,
        Err(error) => return refuse(&error),
    };
    let result = match cli.command {
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Score(arguments) => score::run(&arguments),
        Command::Vds(arguments) => vds::run(&arguments),
        Command::Frames(arguments) => frames::run(&arguments),
        Command::Select(arguments) => select::run(&arguments),
        Command::Metrics(arguments) => metrics::run(&arguments),
        Command::Train(arguments) => train::run(&arguments),
        Command::Proxy(arguments) => proxy::run(&arguments),
        Command::Render(arguments) => render::run(&arguments),
        Command::Capture(arguments) => capture::run(&arguments),
        Command::Export(arguments) => export::run(&arguments),
        Command::Evaluate(arguments) => evaluate::run(&arguments),
        Command::Devices => devices::run(),
        Command::Demo(arguments) => demo::run(&arguments),
        Command::Vdsf(arguments) => vdsf::run(&arguments),
        Command::Quality(arguments) => quality::run(&arguments),
        Command::Completions(arguments) => completions::run(&arguments),
        Command::Manual(arguments) => manual::run(&arguments),
    };
    match result {
        Ok(code) if UNSAID.load(Ordering::Relaxed) => {
            complain!("{NO_ROOM}");
            if code == ExitCode::SUCCESS { ExitCode::FAILURE } else { code }
        }
        Ok(code) => code,
        Err(error) => {
            complain!("error: {error}");
            ExitCode::from(error.exit_code())
        }
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

/// Prints what is wrong with the arguments in one line, as every other error is; help and version go out as they are.
fn refuse(error: &clap::Error) -> ExitCode {
    use ErrorKind::{DisplayHelp, DisplayHelpOnMissingArgumentOrSubcommand, DisplayVersion};
    if matches!(error.kind(), DisplayHelp | DisplayVersion | DisplayHelpOnMissingArgumentOrSubcommand) {
        if let Err(error) = error.print() {
            unsaid(&error);
        }
        if UNSAID.load(Ordering::Relaxed) {
            complain!("{NO_ROOM}");
            return ExitCode::FAILURE;
        }
        return ExitCode::from(u8::try_from(error.exit_code()).unwrap_or(2));
    }
    complain!("{}", one_line(&error.to_string()));
    ExitCode::from(2)
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
