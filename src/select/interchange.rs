//! Making a subset better: swaps of a chosen photo for another until none helps (Whitaker 1983; Resende and Werneck 2007),
//! and the greedy subset as a second place to start from.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::objective::Choice;

/// Part of the cost that a swap must gain, so that rounding cannot make two swaps take turns for ever.
const LEAST_GAIN: f64 = 1e-7;
/// Part of what a swap promised before others were made that it must still be worth to be made in the same round.
const STILL_WORTH: f64 = 0.5;

/// Swaps photos of `candidates` into slots that are not `fixed` while that lowers the cost; returns the cost at first and
/// after every swap. Every round evaluates all candidates, then makes the best swap, and after it those of the others that
/// are still worth half of what they promised. The cost falls with every swap.
pub fn refine(choice: &mut Choice<'_, '_>, candidates: &[usize], fixed: &[bool]) -> Vec<f64> {
    let mut costs = vec![choice.cost()];
    let mut cost = costs[0];
    let mut spared = vec![0.0; choice.chosen().len()];
    loop {
        let outside = without(candidates, choice.chosen());
        let swaps = choice.best_swaps(&outside, fixed);
        let mut order: Vec<usize> = (0..swaps.len()).filter(|i| swaps[*i].change < -LEAST_GAIN * cost).collect();
        order.sort_by(|a, b| swaps[*a].change.total_cmp(&swaps[*b].change).then(outside[*a].cmp(&outside[*b])));
        if order.is_empty() {
            return costs;
        }
        for (rank, i) in order.into_iter().enumerate() {
            let mut swap = swaps[i];
            if rank > 0 {
                swap = choice.best_swap(outside[i], fixed, &mut spared);
                if swap.change > STILL_WORTH * swaps[i].change || swap.change > -LEAST_GAIN * cost {
                    continue;
                }
            }
            choice.replace(swap.slot, outside[i]);
            cost = choice.cost();
            costs.push(cost);
        }
    }
}

/// The candidates that are not chosen.
fn without(candidates: &[usize], chosen: &[usize]) -> Vec<usize> {
    let mut chosen = chosen.to_vec();
    chosen.sort_unstable();
    candidates.iter().copied().filter(|photo| chosen.binary_search(photo).is_err()).collect()
}

/// A candidate and the most that it can gain.
struct Bound(f64, usize);

impl PartialEq for Bound {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Bound {}
impl PartialOrd for Bound {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Bound {
    /// Greater gains first, then lower indices.
    fn cmp(&self, other: &Self) -> Ordering {
        self.0.total_cmp(&other.0).then(other.1.cmp(&self.1))
    }
}

/// Adds candidates, each time the one that lowers the cost most, until there are `count`. Gains only shrink as photos are
/// added, so that most need not be evaluated again (Minoux, "Accelerated greedy algorithms", 1978).
pub fn grow(choice: &mut Choice<'_, '_>, candidates: &[usize], count: usize) {
    let free = without(candidates, choice.chosen());
    let gains = choice.gains(&free);
    let mut bounds: BinaryHeap<Bound> = gains.into_iter().zip(&free).map(|(gain, photo)| Bound(gain, *photo)).collect();
    while choice.chosen().len() < count {
        let Some(Bound(_, photo)) = bounds.pop() else { return };
        let mut spared = vec![0.0; choice.chosen().len()];
        let now = Bound(choice.gain(photo, &mut spared), photo);
        if bounds.peek().is_some_and(|next| *next > now) {
            bounds.push(now);
        } else {
            choice.add(photo);
        }
    }
}
