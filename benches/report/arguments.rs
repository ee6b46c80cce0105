//! The command line of a bench.

use std::path::PathBuf;

use camsplat::{Error, Result};

/// What to measure, and with which report to compare it.
#[derive(Debug, PartialEq)]
pub struct Arguments {
    /// Only rows that have this in `name/count`, or at its end where it has a slash.
    pub filter: Option<String>,
    /// An earlier report of the same bench.
    pub compare: Option<PathBuf>,
    /// How many times as long a row may take as in that report.
    pub factor: f64,
}

impl Arguments {
    /// Reads what follows `cargo bench --bench NAME --`.
    ///
    /// # Errors
    /// Where it is something else than a filter, `--compare FILE` and `--factor NUMBER`.
    pub fn parse(arguments: impl IntoIterator<Item = String>) -> Result<Self> {
        let mut parsed = Self { filter: None, compare: None, factor: 1.02 };
        let mut arguments = arguments.into_iter();
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                // From cargo.
                "--bench" => {}
                "--compare" => {
                    let file = arguments.next().ok_or_else(|| Error::request("--compare needs a file"))?;
                    parsed.compare = Some(file.into());
                }
                "--factor" => {
                    let factor = arguments.next().and_then(|text| text.parse().ok());
                    let factor = factor.filter(|factor| (1.0..f64::INFINITY).contains(factor));
                    parsed.factor = factor.ok_or_else(|| Error::request("--factor needs a number of at least 1"))?;
                }
                other if !other.starts_with('-') && parsed.filter.is_none() => parsed.filter = Some(argument),
                other => {
                    let usage = "the arguments of a bench are [FILTER] [--compare FILE [--factor NUMBER]]";
                    return Err(Error::request(format!("{other:?} is not understood; {usage}")));
                }
            }
        }
        Ok(parsed)
    }

    /// Whether there is a filter that leaves this row in.
    pub fn names(&self, name: &str, count: u64) -> bool {
        let title = format!("{name}/{count}");
        // With a count it is a whole one: 10000 does not stand for 100000.
        let matches =
            |filter: &str| if filter.contains('/') { title.ends_with(filter) } else { title.contains(filter) };
        self.filter.as_deref().is_some_and(matches)
    }

    /// Whether no filter leaves this row out.
    pub fn wants(&self, name: &str, count: u64) -> bool {
        self.filter.is_none() || self.names(name, count)
    }
}
