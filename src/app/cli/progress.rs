//! Progress on the terminal, and Ctrl-C.

use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::session::{self, Ended, Session, go_on};
use crate::engine::parallel::lock;
use crate::planner::plan::pipeline::PlanEvent;
use crate::{Error, Result};

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
    /// What is running closes, having nothing to write.
    Close,
}

/// Lets Ctrl-C (and SIGTERM) stop a run after the iteration that is running; a second one ends the process at once. In a program that
/// listens, signals are the program's.
///
/// # Errors
/// Where the system refuses a signal handler, and where the run is to stop already.
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

/// Lets Ctrl-C (and SIGTERM) close a server; a second one ends the process at once.
///
/// # Errors
/// Where the system refuses a signal handler.
pub fn close_on_interrupt() -> Result<()> {
    hear_interrupts(OnInterrupt::Close)
}

fn hear_interrupts(what: OnInterrupt) -> Result<()> {
    static SET: OnceLock<()> = OnceLock::new();
    if session::current().listener().is_some() {
        return Error::unless_stopped(go_on());
    }
    *lock(&ON_INTERRUPT) = what;
    if SET.set(()).is_err() {
        return Ok(());
    }
    ctrlc::set_handler(|| {
        let what = lock(&ON_INTERRUPT);
        if *what == OnInterrupt::Leave {
            say!("stopped; nothing is written");
            std::process::exit(i32::from(Ended::Stopped.exit_code()));
        }
        if session::interrupt() {
            std::process::exit(i32::from(Ended::Stopped.exit_code()));
        }
        match *what {
            OnInterrupt::Withdraw => say!("stopping"),
            OnInterrupt::Close => say!("stopped"),
            OnInterrupt::Finish | OnInterrupt::Leave => {
                say!("stopping once what is running has ended and is written; another Ctrl-C ends at once and loses it")
            }
        }
    })
    .map_err(|e| Error::request(format!("Ctrl-C cannot be watched for: {e}")))
}

/// Time between two lines of progress where there is no terminal.
const BETWEEN_LINES: Duration = Duration::from_secs(10);

/// A time as a person would guess it.
fn roughly(time: Duration) -> String {
    match time.as_secs() {
        seconds @ 0..100 => format!("{} s", seconds.max(1)),
        seconds @ 100..6000 => format!("{} min", (seconds + 30) / 60),
        seconds => format!("{:.1} h", seconds as f64 / 3600.0),
    }
}

/// A bar that follows a run; without a terminal, a line as soon as units are done and then one every ten seconds; in a program that listens,
/// neither.
pub struct Progress {
    bar: ProgressBar,
    doing: RefCell<String>,
    unit: &'static str,
    told: Cell<Option<Instant>>,
    session: Arc<Session>,
}

impl Progress {
    /// A bar for so many iterations of a plan.
    pub fn new(iterations: u32) -> Self {
        Self::over("planning", iterations, "iterations")
    }

    /// A bar for so many units of what is being done.
    pub fn over(doing: &str, all: u32, unit: &'static str) -> Self {
        let session = session::current();
        let bar = match session.listener() {
            Some(_) => ProgressBar::hidden(),
            None => ProgressBar::new(u64::from(all)),
        };
        let style = ProgressStyle::with_template("{msg:10} {wide_bar} {pos}/{len} {per_sec}, {eta} left");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let progress = Self { bar, doing: RefCell::default(), unit, told: Cell::default(), session };
        progress.name(doing);
        progress
    }

    /// Names what is being done from here on.
    pub fn name(&self, doing: &str) {
        doing.clone_into(&mut self.doing.borrow_mut());
        self.bar.set_message(doing.to_owned());
    }

    /// Takes note that so many units are done and says whether to go on.
    pub fn advance(&self, done: u32, all: u32) -> ControlFlow<()> {
        self.set(done, all);
        if done > 0 && done < all {
            self.tell(|| match self.told.get() {
                None => format!("running  {all} {}; a line every {} s", self.unit, BETWEEN_LINES.as_secs()),
                Some(_) => format!("running  {done} of {all} {}, {} left", self.unit, self.left()),
            });
        }
        go_on()
    }

    /// Takes note that so many units are done.
    pub fn set(&self, done: u32, all: u32) {
        if self.bar.length() != Some(u64::from(all)) {
            self.bar.reset();
            self.bar.set_length(u64::from(all));
        }
        self.bar.set_position(u64::from(done));
        if let Some(listener) = self.session.listener() {
            listener.progress(&self.doing.borrow(), u64::from(done), u64::from(all));
        }
    }

    /// How much time is left, by the pace so far.
    pub fn left(&self) -> String {
        roughly(self.bar.eta())
    }

    /// Prints a line where nothing shows the bar and the last such line is old.
    pub fn tell(&self, line: impl FnOnce() -> String) {
        let is_due = self.told.get().is_none_or(|told| told.elapsed() >= BETWEEN_LINES);
        if is_due && self.bar.is_hidden() && self.session.listener().is_none() {
            say!("{}", line());
            self.told.set(Some(Instant::now()));
        }
    }

    /// Prints a line above the bar.
    pub fn line(&self, text: &str) {
        self.bar.suspend(|| say!("{text}"));
    }

    /// Takes note of an event and says whether to go on.
    pub fn observe(&self, event: PlanEvent) -> ControlFlow<()> {
        match event {
            PlanEvent::Iterations(done, all) => return self.advance(done, all),
            PlanEvent::Preparing => {
                if let Some(listener) = self.session.listener() {
                    listener.progress("preparing", 0, 1);
                }
            }
            PlanEvent::Captured(path) => self.line(&format!("capture  {}", path.display())),
            PlanEvent::Scoring => {
                self.bar.set_style(
                    ProgressStyle::with_template("{msg}").unwrap_or_else(|_| ProgressStyle::default_spinner()),
                );
                self.name("scoring");
            }
        }
        go_on()
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, whoever waits for photographs would be told hours for minutes.
    #[test]
    fn times_are_told_in_units_that_suit_them() {
        let told = |seconds| roughly(Duration::from_secs(seconds));
        assert_eq!([0, 9, 99, 100, 3599, 7200].map(told), ["1 s", "9 s", "99 s", "2 min", "60 min", "2.0 h"]);
    }
}
