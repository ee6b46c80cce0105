//! Commands inside a Python program.

use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use camsplat::app::cli::{self, Listener, Outcome};
use pyo3::prelude::*;

use super::{Error, unless_forked};

/// Time between two looks at what Python's signal handlers have to do, and between two calls with progress.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);

/// Runs the command line as the program does, on the process's own standard output, and returns the exit code.
#[pyfunction]
pub fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| cli::main(arguments))
}

/// What a command has said and its caller has not yet been told.
#[derive(Default)]
struct News {
    lines: Vec<String>,
    /// What is being done, how many units of it are done, and of how many.
    progress: Option<(String, u64, u64)>,
    /// How it ended; where it panicked, with what.
    ended: Option<Result<Outcome, Box<dyn Any + Send>>>,
}

/// Takes what a command has to say to the thread that called it.
#[derive(Default)]
struct Mailbox {
    news: Mutex<News>,
    /// A line has come, or the end.
    arrived: Condvar,
    stop: AtomicBool,
    drops_parts: bool,
}

impl Mailbox {
    fn news(&self) -> MutexGuard<'_, News> {
        self.news.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for news, but not for long.
    fn wait(&self) -> News {
        let is_none = |news: &mut News| news.lines.is_empty() && news.ended.is_none();
        let waited = self.arrived.wait_timeout_while(self.news(), BETWEEN_LOOKS, is_none);
        std::mem::take(&mut waited.unwrap_or_else(PoisonError::into_inner).0)
    }
}

impl Listener for Mailbox {
    fn line(&self, text: &str) {
        self.news().lines.push(text.to_owned());
        self.arrived.notify_one();
    }

    fn progress(&self, doing: &str, done: u64, all: u64) {
        self.news().progress = Some((doing.to_owned(), done, all));
    }

    fn stops(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn drops_parts(&self) -> bool {
        self.drops_parts
    }
}

/// Runs a command: its arguments without the program's name. `on_line` is called with every line that it prints, `on_progress` a few times
/// a second with what is being done, the units that are done, and all of them. The command runs on a thread of its own and the
/// interpreter goes on; callbacks run on the caller's thread. Where one raises, or Ctrl-C is pressed, the command is stopped as Ctrl-C on a
/// terminal stops it, and the exception is raised once it has ended. What is stopped is not worth finishing where it `drops_parts`.
#[pyfunction]
#[pyo3(signature = (arguments, on_line, on_progress, drops_parts=false))]
pub fn run(
    py: Python<'_>,
    arguments: Vec<OsString>,
    on_line: &Bound<'_, PyAny>,
    on_progress: &Bound<'_, PyAny>,
    drops_parts: bool,
) -> PyResult<()> {
    unless_forked()?;
    let mailbox = Arc::new(Mailbox { drops_parts, ..Mailbox::default() });
    let worker = Arc::clone(&mailbox);
    thread::spawn(move || {
        let listener = Arc::clone(&worker);
        let ended = catch_unwind(AssertUnwindSafe(|| cli::run(arguments, listener)));
        worker.news().ended = Some(ended);
        worker.arrived.notify_one();
    });
    let mut raised = None;
    let ended = loop {
        let News { lines, progress, ended } = py.detach(|| mailbox.wait());
        let told = py.check_signals().and_then(|()| {
            if raised.is_some() {
                // Who raised an exception hears no more.
                return Ok(());
            }
            for line in lines {
                on_line.call1((line,))?;
            }
            progress.map_or(Ok(()), |progress| on_progress.call1(progress).map(drop))
        });
        if let Err(error) = told {
            mailbox.stop.store(true, Ordering::Relaxed);
            raised.get_or_insert(error);
        }
        if let Some(ended) = ended {
            break ended;
        }
    };
    match (raised, ended.unwrap_or_else(|panic| resume_unwind(panic))) {
        (Some(error), _) => Err(error),
        (None, Outcome::Done) => Ok(()),
        (None, Outcome::Stopped) => Err(Error::new_err("stopped, as it was asked to; what is finished stays")),
        (None, Outcome::Failed { line, .. }) => Err(Error::new_err(line)),
    }
}
