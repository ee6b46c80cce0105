//! Making a subset better: swaps of a chosen photo for another until none helps (Whitaker 1983; Resende and Werneck 2007).

use super::objective::{Choice, Swap};

/// What a swap must gain, in decibels: less is invisible, and rounding cannot make two swaps alternate forever.
const MIN_GAIN: f64 = 1e-4;
/// Part of what a swap promised before others were made that it must still be worth to be made in the same pass.
const STILL_WORTH: f64 = 0.5;

/// Candidates that are evaluated again together, so that threads have work to share.
const TOGETHER: usize = 32;

/// Swaps photos of `candidates` into slots that are not `fixed` while that lowers the cost; returns the cost at first and
/// after every swap. Every pass evaluates all candidates, then makes the best swap, and after it those of the others that
/// are still worth half of what they promised. The cost falls with every swap.
pub fn refine(choice: &mut Choice<'_>, candidates: &[usize], fixed: &[bool]) -> Vec<f64> {
    let mut costs = vec![choice.cost()];
    loop {
        let outside = without(candidates, choice.chosen());
        let swaps = choice.best_swaps(&outside, fixed);
        let worth = |swap: &Swap| swap.change < -MIN_GAIN;
        let mut promised: Vec<(usize, Swap)> = outside.into_iter().zip(swaps).collect();
        promised.retain(|(_, swap)| worth(swap));
        promised.sort_by(|(a, one), (b, other)| one.change.total_cmp(&other.change).then(a.cmp(b)));
        let [(photo, swap), others @ ..] = &promised[..] else { return costs };
        let mut make = |choice: &mut Choice<'_>, photo: usize, swap: Swap| {
            choice.replace(swap.slot, photo);
            costs.push(choice.cost());
        };
        make(choice, *photo, *swap);
        // A few more at a time while none is still worth it: a swap makes what is known of those behind it out of date.
        let (mut others, mut few) = (others, 1);
        while !others.is_empty() {
            let (next, rest) = others.split_at(few.min(others.len()));
            let photos: Vec<usize> = next.iter().map(|(photo, _)| *photo).collect();
            let swaps = choice.best_swaps(&photos, fixed);
            let still = |(i, swap): &(usize, Swap)| swap.change <= STILL_WORTH * next[*i].1.change && worth(swap);
            match swaps.into_iter().enumerate().find(still) {
                Some((i, swap)) => {
                    make(choice, photos[i], swap);
                    (others, few) = (&others[i + 1..], 1);
                }
                None => (others, few) = (rest, TOGETHER.min(2 * few)),
            }
        }
    }
}

/// The candidates that are not chosen.
fn without(candidates: &[usize], chosen: &[usize]) -> Vec<usize> {
    let mut chosen = chosen.to_vec();
    chosen.sort_unstable();
    candidates.iter().copied().filter(|photo| chosen.binary_search(photo).is_err()).collect()
}
