//! The page of an evaluation while it runs.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::Result;
use crate::app::report;
use crate::files::io::folder::write_files;
use crate::lab::evaluate::request::EvaluationRequest;
use crate::lab::evaluate::results::Outcome;
use crate::lab::evaluate::subject::Subject;

/// The HTML page, which is made again as runs are completed, but takes no more than a small part of the time: it takes up to half a second
/// for each scene of many triangles, and a run of one of them takes ten.
pub(super) struct Page<'a> {
    file: PathBuf,
    request: &'a EvaluationRequest,
    subjects: &'a [Subject],
    /// What the page does not show yet.
    pending: Option<Outcome>,
    /// When it was made, and how long that took.
    made: Option<(Instant, Duration)>,
    result: Result<()>,
}

impl<'a> Page<'a> {
    /// Of the time between two pages, they may take one part in so many.
    const PART: u32 = 20;

    /// The page of the evaluation in `folder`, with the layouts of these subjects.
    pub fn new(folder: &Path, request: &'a EvaluationRequest, subjects: &'a [Subject]) -> Self {
        Self { file: folder.join("report.html"), request, subjects, pending: None, made: None, result: Ok(()) }
    }

    /// Shows an outcome, now or later.
    pub fn show(&mut self, outcome: &Outcome) {
        self.pending = Some(outcome.clone());
        if outcome.left == 0 || self.made.is_none_or(|(made, took)| made.elapsed() > Self::PART * took) {
            self.make();
        }
    }

    fn make(&mut self) {
        let Some(outcome) = self.pending.take() else { return };
        let start = Instant::now();
        let html = report::evaluation::html(self.request, &outcome, self.subjects);
        self.result = html.and_then(|html| write_files(&[(&self.file, html.as_bytes())]));
        self.made = Some((Instant::now(), start.elapsed()));
    }

    /// Shows what is yet to be shown; the page's place, where there is one.
    ///
    /// # Errors
    /// Where the page could not be made or written.
    pub fn finish(mut self) -> Result<Option<PathBuf>> {
        self.make();
        self.result.map(|()| self.made.is_some().then_some(self.file))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::evaluate::competitor::Competitor;
    use crate::lab::evaluate::kind::Kind;
    use crate::planner::methods::Method;

    /// A page of many scenes takes seconds: one after every run would make whole evaluations slower, and without one at the end the last
    /// runs would be missing.
    #[test]
    fn pages_take_a_small_part_of_the_time_and_the_last_one_shows_everything() {
        let folder = tempfile::tempdir().unwrap();
        let request = EvaluationRequest::quick(Kind::Object, vec![Competitor::Method(Method::Ours)], vec![4]);
        let mut page = Page::new(folder.path(), &request, &[]);
        let shows = |left: usize| {
            let text = std::fs::read_to_string(folder.path().join("report.html")).unwrap_or_default();
            text.contains(&format!("{left} runs to come"))
        };
        let outcome = |left| Outcome { left, ..Outcome::new(Kind::Object, Vec::new(), 0) };
        page.show(&outcome(3));
        assert!(shows(3), "the first is made at once");
        page.made = Some((Instant::now(), Duration::from_secs(3600)));
        page.show(&outcome(2));
        assert!(shows(3) && !shows(2), "it took an hour, and there is another now");
        page.made = Some((Instant::now(), Duration::ZERO));
        page.show(&outcome(2));
        assert!(shows(2), "it took no time, and there is none now");
        page.made = Some((Instant::now(), Duration::from_secs(3600)));
        page.show(&outcome(1));
        assert!(page.finish().unwrap().is_some() && shows(1), "what was stopped does not show its last run");
    }
}
