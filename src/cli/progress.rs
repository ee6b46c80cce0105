//! Progress on the terminal, and Ctrl-C.

use std::cell::Cell;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::parallel::lock;
use crate::plan::job::Event;
use crate::{Error, Result};

/// Set once the user has asked to stop.
static STOP: AtomicBool = AtomicBool::new(false);
/// What Ctrl-C does. The handler holds it while it ends the process, so that nothing begins to be written then.
static ON_INTERRUPT: Mutex<OnInterrupt> = Mutex::new(OnInterrupt::Finish);

/// What the first Ctrl-C does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OnInterrupt {
    /// What is running ends and is written.
    Finish,
    /// What is running ends, and nothing is written.
    Withdraw,
    /// The process ends at once.
    Leave,
}

/// Lets Ctrl-C (and SIGTERM) stop a run after the iteration that is running; a second one ends the process at once.
///
/// # Errors
/// Where the system refuses a signal handler.
pub fn stop_on_interrupt() -> Result<()> {
    hear_interrupts(OnInterrupt::Finish)
}

/// Lets Ctrl-C (and SIGTERM) stop a run that takes back what it has written so far; a second one ends the process at once.
///
/// # Errors
/// Where the system refuses a signal handler.
pub fn withdraw_on_interrupt() -> Result<()> {
    hear_interrupts(OnInterrupt::Withdraw)
}

/// Lets Ctrl-C (and SIGTERM) end the process at once, with the exit code of a stopped run, while nothing has been written; until
/// [`stop_on_interrupt`] is called.
///
/// # Errors
/// Where the system refuses a signal handler.
pub fn leave_on_interrupt() -> Result<()> {
    hear_interrupts(OnInterrupt::Leave)
}

fn hear_interrupts(what: OnInterrupt) -> Result<()> {
    static SET: OnceLock<()> = OnceLock::new();
    *lock(&ON_INTERRUPT) = what;
    if SET.set(()).is_err() {
        return Ok(());
    }
    ctrlc::set_handler(|| {
        let what = lock(&ON_INTERRUPT);
        if *what == OnInterrupt::Leave {
            say!("stopped; nothing is written");
            std::process::exit(i32::from(super::INTERRUPTED));
        }
        if STOP.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(super::INTERRUPTED));
        }
        match *what {
            OnInterrupt::Withdraw => say!("stopping"),
            _ => {
                say!("stopping once what is running has ended and is written; another Ctrl-C ends at once and loses it")
            }
        }
    })
    .map_err(|e| Error::request(format!("Ctrl-C cannot be watched for: {e}")))
}

/// Time between two lines of progress where there is no terminal.
pub const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// A bar that follows a run; without a terminal, a line as soon as iterations run and then one every ten seconds.
pub struct Progress {
    bar: ProgressBar,
    unit: &'static str,
    told: Cell<Option<Instant>>,
}

impl Progress {
    /// A bar for so many iterations of a plan.
    pub fn new(iterations: u32) -> Self {
        Self::over("planning", iterations, "iterations")
    }

    /// A bar for so many units of what is being done.
    pub fn over(doing: &'static str, all: u32, unit: &'static str) -> Self {
        let bar = ProgressBar::new(u64::from(all));
        let style = ProgressStyle::with_template("{msg:10} {wide_bar} {pos}/{len} {per_sec}, {eta} left");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(doing);
        Self { bar, unit, told: Cell::default() }
    }

    /// Takes note that so many units are done and says whether to go on.
    pub fn advance(&self, done: u32, all: u32) -> ControlFlow<()> {
        self.bar.set_length(u64::from(all));
        self.bar.set_position(u64::from(done));
        let due = self.told.get().is_none_or(|told| told.elapsed() >= BETWEEN_LINES);
        if self.bar.is_hidden() && done > 0 && done < all && due {
            match self.told.get() {
                None => say!("running  {all} {}; a line every {} s", self.unit, BETWEEN_LINES.as_secs()),
                Some(_) => say!("running  {done} of {all} {}", self.unit),
            }
            self.told.set(Some(Instant::now()));
        }
        go_on()
    }

    /// Takes note of an event and says whether to go on.
    pub fn observe(&self, event: Event) -> ControlFlow<()> {
        match event {
            Event::Iterations(done, all) => return self.advance(done, all),
            Event::Captured(path) => self.bar.suspend(|| say!("capture  {}", path.display())),
            Event::Scoring => {
                self.bar.set_style(
                    ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_spinner()),
                );
                self.bar.set_message("scoring");
            }
        }
        go_on()
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

/// Whether the user has not asked to stop.
pub fn go_on() -> ControlFlow<()> {
    if STOP.load(Ordering::SeqCst) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
