//! What a reader leaves out of a file rather than refuse all of it.

use crate::error::bounded;

/// Items of one kind that were left out: how many, and what is wrong with the first few.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LeftOut {
    count: usize,
    first: Vec<String>,
}

/// How many are named.
const NAMED: usize = 3;

impl LeftOut {
    /// One more item; `what` names it and says what is wrong with it.
    pub fn add(&mut self, what: impl Into<String>) {
        self.count += 1;
        if self.first.len() < NAMED {
            self.first.push(what.into());
        }
    }

    /// Whether nothing was left out.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// What is wrong with the first item.
    pub fn first(&self) -> Option<&str> {
        self.first.first().map(String::as_str)
    }

    /// A line for the user; `items` names what was left out ("images"). Nothing where all were taken.
    pub fn note(&self, items: &str, notes: &mut Vec<String>) {
        if self.is_empty() {
            return;
        }
        let more = match self.count - self.first.len() {
            0 => String::new(),
            more => format!("; and {more} more"),
        };
        notes.push(bounded(format!("{items} left out: {}; {}{more}", self.count, self.first.join("; "))));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a user would not learn how much of a file is missing, or a note be as long as the file.
    #[test]
    fn a_few_are_named_and_all_are_counted() {
        let mut notes = Vec::new();
        let mut left_out = LeftOut::default();
        left_out.note("images", &mut notes);
        assert!(notes.is_empty() && left_out.is_empty());
        (0..5).for_each(|i| left_out.add(format!("image {i} has no pose")));
        left_out.note("images", &mut notes);
        let three = "image 0 has no pose; image 1 has no pose; image 2 has no pose";
        assert_eq!(notes, [format!("images left out: 5; {three}; and 2 more")]);
        assert_eq!(left_out.first(), Some("image 0 has no pose"));
    }
}
