//! Greedy choice of views by the information they add to what is known, the most informative first.

use std::cmp::{Ordering, Reverse};
use std::collections::BinaryHeap;

use crate::Result;
use crate::splats::uncertainty::cover::Cover;
use crate::splats::uncertainty::fisher::Fisher;

/// What is known from views that have been taken. The more is known, the less a view is worth.
pub(crate) trait Knowledge {
    /// What a view is worth.
    ///
    /// # Errors
    /// Where the device fails.
    fn worth(&mut self, view: usize) -> Result<f64>;

    /// Takes a view.
    ///
    /// # Errors
    /// Where the device fails.
    fn learn(&mut self, view: usize) -> Result<()>;
}

impl Knowledge for Fisher {
    fn worth(&mut self, view: usize) -> Result<f64> {
        self.worth(view)
    }

    fn learn(&mut self, view: usize) -> Result<()> {
        self.learn(view)
    }
}

impl Knowledge for Cover {
    fn worth(&mut self, view: usize) -> Result<f64> {
        self.worth(view)
    }

    fn learn(&mut self, view: usize) -> Result<()> {
        self.learn(view)
    }
}

/// NaN counts as least.
#[derive(Clone, Copy, Debug)]
struct Worth(f64);

impl Ord for Worth {
    fn cmp(&self, other: &Self) -> Ordering {
        let [a, b] = [self.0, other.0].map(|worth| if worth.is_nan() { f64::NEG_INFINITY } else { worth });
        a.total_cmp(&b)
    }
}

impl PartialOrd for Worth {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Worth {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Worth {}

/// Takes the views `chosen`, and then of `free` the one that is worth most, of equals the first, until `count` are chosen. What
/// a view was worth is a bound on what it is worth later, so that most need not be evaluated again (Minoux 1978).
///
/// # Errors
/// Where the device fails.
pub fn grow(
    knowledge: &mut impl Knowledge,
    mut chosen: Vec<usize>,
    free: &[usize],
    count: usize,
) -> Result<Vec<usize>> {
    for view in &chosen {
        knowledge.learn(*view)?;
    }
    let mut bounds = BinaryHeap::new();
    if chosen.len() < count {
        for view in free {
            bounds.push((Worth(knowledge.worth(*view)?), Reverse(*view), chosen.len()));
        }
    }
    while chosen.len() < count {
        let Some((_, Reverse(view), known)) = bounds.pop() else { break };
        if known < chosen.len() {
            bounds.push((Worth(knowledge.worth(view)?), Reverse(view), chosen.len()));
            continue;
        }
        chosen.push(view);
        // The last view's information is not needed.
        if chosen.len() < count {
            knowledge.learn(view)?;
        }
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// Every view adds a little information about some of 40 items.
    struct Things {
        gains: Vec<Vec<f64>>,
        known: Vec<f64>,
        asked: usize,
    }

    impl Things {
        fn new() -> Self {
            let gains = |view: u32| (0..40).map(|k| random::uniforms(3, view, k)[0].powi(8)).collect();
            Self { gains: (0..60).map(gains).collect(), known: vec![0.0; 40], asked: 0 }
        }

        fn value(&self, view: usize) -> f64 {
            self.gains[view].iter().zip(&self.known).map(|(gains, known)| gains / (known + 0.1)).sum()
        }
    }

    impl Knowledge for Things {
        fn worth(&mut self, view: usize) -> Result<f64> {
            self.asked += 1;
            Ok(self.value(view))
        }

        fn learn(&mut self, view: usize) -> Result<()> {
            self.known.iter_mut().zip(&self.gains[view]).for_each(|(known, gains)| *known += gains);
            Ok(())
        }
    }

    /// If this failed, old bounds would be taken for what views are worth, and another view than the best be chosen.
    #[test]
    fn every_pick_is_the_best_and_few_are_looked_at_again() {
        let (mut things, mut plain) = (Things::new(), Things::new());
        let free: Vec<usize> = (0..60).filter(|view| *view != 7).collect();
        let chosen = grow(&mut things, vec![7], &free, 20).unwrap();
        plain.learn(7).unwrap();
        for (i, view) in chosen.iter().enumerate().skip(1) {
            let left = free.iter().filter(|view| !chosen[..i].contains(view));
            let best = left.copied().reduce(|a, b| if plain.value(b) > plain.value(a) { b } else { a });
            assert_eq!(Some(*view), best, "pick {i}");
            plain.learn(*view).unwrap();
        }
        assert_eq!((chosen.len(), chosen[0]), (20, 7));
        assert!(things.asked < 59 + 19 * 20, "{} looks", things.asked);
        assert_eq!(grow(&mut Things::new(), Vec::new(), &free, 100).unwrap().len(), 59);
    }
}
