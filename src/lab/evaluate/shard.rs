//! A part of an evaluation's runs, for one of several machines.

use std::ops::Range;
use std::str::FromStr;

/// Part `number`, counted from 1, of `of` parts. Parts are contiguous, so that each has few subjects whose shared results it must make,
/// disjoint, and together all runs; their sizes differ by one at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

impl Shard {
    /// All runs.
    pub const WHOLE: Self = Self { number: 1, of: 1 };

    /// Whether this is all runs.
    pub fn is_whole(self) -> bool {
        self.of == 1
    }

    /// The numbers of its runs out of `all`.
    pub fn runs(self, all: usize) -> Range<usize> {
        let before = |parts: usize| (parts as u128 * all as u128 / self.of as u128) as usize;
        before(self.number - 1)..before(self.number)
    }
}

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} of {}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        match parsed {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("give I/N with I from 1 to N, such as 2/8".into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, machines would make a run twice, or none of them would make it.
    #[test]
    fn shards_are_disjoint_and_complete() {
        for (all, of) in [(0, 3), (1, 1), (7, 3), (12, 4), (3, 8), (1000, 7)] {
            let parts: Vec<_> = (1..=of).map(|i| format!("{i}/{of}").parse::<Shard>().unwrap().runs(all)).collect();
            assert_eq!(parts.iter().cloned().flatten().collect::<Vec<_>>(), (0..all).collect::<Vec<_>>());
            let sizes: Vec<_> = parts.iter().map(ExactSizeIterator::len).collect();
            assert!(sizes.iter().max().unwrap() - sizes.iter().min().unwrap() <= 1, "{sizes:?}");
        }
        for bad in ["0/2", "3/2", "1", "1/0", "-1/2", "a/b", "1/2/3", ""] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
