//! Making a subset better: swaps of a chosen photo for another until none helps (Whitaker 1983; Resende and Werneck 2007),
//! and the greedy subset as a second place to start from.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::objective::Choice;

/// Part of the cost that a swap must gain, so that rounding cannot make two swaps take turns for ever.
const LEAST_GAIN: f64 = 1e-7;
/// Part of what a swap promised before others were made that it must still be worth to be made in the same round.
const STILL_WORTH: f64 = 0.5;

/// Candidates whose gains are taken again together, so that threads have something to share.
const TOGETHER: usize = 32;

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

/// The most that a candidate can gain, by its gain when there were so many photos.
struct Bound {
    gain: f64,
    photo: usize,
    photos: usize,
}

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
        self.gain.total_cmp(&other.gain).then(other.photo.cmp(&self.photo))
    }
}

/// Adds candidates, each time the one that lowers the cost most, until there are `count`. Gains only shrink as photos are
/// added, so that most need not be evaluated again (Minoux, "Accelerated greedy algorithms", 1978).
pub fn grow(choice: &mut Choice<'_, '_>, candidates: &[usize], count: usize) {
    let mut stale = without(candidates, choice.chosen());
    let mut bounds = BinaryHeap::new();
    while choice.chosen().len() < count {
        let photos = choice.chosen().len();
        let gains = choice.gains(&stale);
        bounds.extend(gains.into_iter().zip(stale.drain(..)).map(|(gain, photo)| Bound { gain, photo, photos }));
        match bounds.pop() {
            None => return,
            Some(best) if best.photos == photos => choice.add(best.photo),
            Some(first) => {
                stale.push(first.photo);
                while stale.len() < TOGETHER && bounds.peek().is_some_and(|next| next.photos < photos) {
                    stale.extend(bounds.pop().map(|next| next.photo));
                }
            }
        }
    }
}
