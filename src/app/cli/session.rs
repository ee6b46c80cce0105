//! One run of a command: where its lines go, who follows its progress, and whether it is to stop.

use std::cell::RefCell;
use std::io::Write as _;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Id};

use super::shell;
use crate::engine::parallel::lock;

/// A program that runs a command inside itself, see [`super::run`]. It is called from the threads that the command runs on.
pub trait Listener: Send + Sync {
    /// Takes a line that the command would print.
    fn line(&self, text: &str);
    /// Takes note that `done` units out of `all` of what is being done are done.
    fn progress(&self, doing: &str, done: u64, all: u64);
    /// Whether the command is to stop: asked every few milliseconds while it may. What is finished by then is written.
    fn stops(&self) -> bool;
    /// Whether what a stopped command leaves is of no use, and is not worth the time to make.
    fn drops_parts(&self) -> bool {
        false
    }
}

/// How a command ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// All that was asked for is done.
    Done,
    /// The user stopped it; what there was is written, as the command has said.
    Stopped,
}

impl Ended {
    /// Exit code of the process; after a stop 128 + SIGINT, as shells have it.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Stopped => 130,
        }
    }
}

/// Set once the user of a terminal has asked to stop.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// One run of a command, on a terminal where nothing listens.
#[derive(Default)]
pub struct Session {
    /// Names of the command's arguments as the library has them, each with its option.
    options: Vec<(String, String)>,
    /// The options that were given, each with its name and its words for a shell.
    given: Vec<(Id, String)>,
    /// Whether something could not be printed though there is still a reader.
    unsaid: AtomicBool,
    /// Whether standard output is for an answer that a program reads.
    aside: AtomicBool,
    listener: Option<Arc<dyn Listener>>,
}

thread_local! {
    static CURRENT: RefCell<Arc<Session>> = RefCell::default();
}

/// The session of this thread.
pub fn current() -> Arc<Session> {
    CURRENT.with_borrow(Arc::clone)
}

impl Session {
    /// A session with the options of the command that the arguments name.
    pub fn new(listener: Option<Arc<dyn Listener>>, command: &clap::Command, matches: &ArgMatches) -> Self {
        let (command, matches) = named(command, matches);
        Self { options: options_of(command), given: given(command, matches), listener, ..Self::default() }
    }

    /// What was given of the options in `group`, each after a space, for a command that has them too.
    pub fn given(&self, group: &clap::Command) -> String {
        let is_of_group = |id: &Id| group.get_arguments().any(|arg| arg.get_id() == id);
        self.given.iter().filter(|(id, _)| is_of_group(id)).map(|(_, words)| format!(" {words}")).collect()
    }

    /// Calls `work`, on any thread, in this session.
    pub fn within<T>(self: &Arc<Self>, work: impl FnOnce() -> T) -> T {
        /// Puts the session before this one back, after a panic too.
        struct Before(Arc<Session>);
        impl Drop for Before {
            fn drop(&mut self) {
                CURRENT.with_borrow_mut(|current| std::mem::swap(current, &mut self.0));
            }
        }
        let _before = Before(CURRENT.replace(Arc::clone(self)));
        work()
    }

    /// What the library says, with the command's options in place of settings: `` `held_out` `` is `--held-out`.
    pub fn with_options(&self, text: String) -> String {
        if !text.contains('`') {
            return text;
        }
        self.options.iter().fold(text, |text, (setting, option)| text.replace(setting, option))
    }

    /// Prints a line. Who reads it may be gone (`camsplat plan ... | head -1`); that is no reason to lose a plan, so what
    /// cannot be printed is not; for any other reason (a full disk) the exit code reports it, see [`Self::lost_lines`].
    pub fn say(&self, text: String) {
        if self.aside.load(Ordering::Relaxed) {
            return self.complain(text);
        }
        let text = self.with_options(text);
        match &self.listener {
            Some(listener) => text.lines().for_each(|line| listener.line(line)),
            None => self.printed(writeln!(std::io::stdout(), "{text}")),
        }
    }

    /// Keeps standard output for [`Self::answer`]: lines go to standard error.
    pub fn set_aside(&self) {
        self.aside.store(true, Ordering::Relaxed);
    }

    /// Prints what a program reads, as it is.
    pub fn answer(&self, text: &str) {
        match &self.listener {
            Some(listener) => text.lines().for_each(|line| listener.line(line)),
            None => self.printed(writeln!(std::io::stdout(), "{text}")),
        }
    }

    /// See [`Listener::drops_parts`]; at a terminal what is finished is kept.
    pub fn drops_parts(&self) -> bool {
        self.listener.as_ref().is_some_and(|listener| listener.drops_parts())
    }

    /// As [`Self::say`], to standard error.
    pub fn complain(&self, text: String) {
        let text = self.with_options(text);
        match &self.listener {
            Some(listener) => text.lines().for_each(|line| listener.line(line)),
            None => drop(writeln!(std::io::stderr(), "{text}")),
        }
    }

    /// Takes note of whether standard output took what was printed.
    pub fn printed(&self, printed: std::io::Result<()>) {
        if printed.is_err_and(|error| error.kind() != std::io::ErrorKind::BrokenPipe) {
            self.unsaid.store(true, Ordering::Relaxed);
        }
    }

    /// Whether something could not be printed though there is still a reader.
    pub fn lost_lines(&self) -> bool {
        self.unsaid.load(Ordering::Relaxed)
    }

    /// Who listens; none on a terminal.
    pub fn listener(&self) -> Option<&dyn Listener> {
        self.listener.as_deref()
    }
}

/// Asks the command that runs on the terminal to stop; returns whether it had been asked before.
pub fn interrupt() -> bool {
    INTERRUPTED.swap(true, Ordering::SeqCst)
}

/// Whether the user has not asked to stop.
pub fn go_on() -> ControlFlow<()> {
    let stops = match current().listener() {
        Some(listener) => listener.stops(),
        None => INTERRUPTED.load(Ordering::SeqCst),
    };
    if stops { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// Keeps lines from being printed.
struct Overhearing {
    lines: Mutex<Vec<String>>,
    of: Arc<Session>,
}

impl Listener for Overhearing {
    fn line(&self, text: &str) {
        lock(&self.lines).push(text.to_owned());
    }

    fn progress(&self, _: &str, _: u64, _: u64) {}

    fn stops(&self) -> bool {
        self.of.within(go_on).is_break()
    }
}

/// Calls `work`; what it would have printed is added to `lines`.
pub fn overheard<T>(lines: &mut Vec<String>, work: impl FnOnce() -> T) -> T {
    let of = current();
    let listener = Arc::new(Overhearing { lines: Mutex::default(), of: Arc::clone(&of) });
    let inner =
        Arc::new(Session { options: of.options.clone(), listener: Some(listener.clone()), ..Session::default() });
    let done = inner.within(work);
    lines.append(&mut lock(&listener.lines));
    done
}

/// The command that the arguments name, with its own.
fn named<'a>(command: &'a clap::Command, matches: &'a ArgMatches) -> (&'a clap::Command, &'a ArgMatches) {
    let inner = matches.subcommand().and_then(|(name, matches)| Some((command.find_subcommand(name)?, matches)));
    inner.map_or((command, matches), |(command, matches)| named(command, matches))
}

/// The options of a command, see [`Session::with_options`].
fn options_of(command: &clap::Command) -> Vec<(String, String)> {
    // A field that would be a keyword ends in an underscore.
    let setting = |arg: &Arg| format!("`{}`", arg.get_id().as_str().trim_end_matches('_'));
    let named = |arg: &Arg| arg.get_long().map(|long| (setting(arg), format!("--{long}")));
    command.get_arguments().filter_map(named).collect()
}

/// The options that were given, each time that one was.
fn given(command: &clap::Command, matches: &ArgMatches) -> Vec<(Id, String)> {
    let mut given = Vec::new();
    let is_given = |arg: &&Arg| matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine);
    for arg in command.get_arguments().filter(is_given) {
        let Some(long) = arg.get_long() else { continue };
        for values in matches.get_raw_occurrences(arg.get_id().as_str()).into_iter().flatten() {
            let values: Vec<_> = values.map(|value| value.to_string_lossy()).collect();
            let words = match arg.get_action().takes_values() {
                true => format!("--{long} {}", shell::quoted(&values.join(","))),
                false => format!("--{long}"),
            };
            given.push((arg.get_id().clone(), words));
        }
    }
    given
}
