//! Few values in place of many: 256 numbers for all of a column, and a palette of vectors.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Numbers in a codebook.
const SIZE: usize = 256;

/// Rounds of Lloyd's algorithm, and of the same between two means: more change the last digits.
const ROUNDS: usize = 20;
const BORDER_ROUNDS: usize = 4;

/// Bins of the histogram that a codebook begins from.
const BINS: usize = 4096;

/// 256 numbers in rising order of which one is near each value, by Lloyd's algorithm (one-dimensional k-means). It begins with as many
/// numbers where values lie as is best where there are very many, the third root of their density (Panter and Dite 1951).
pub(super) fn codebook(values: impl Iterator<Item = f32>) -> Vec<f32> {
    let mut sorted: Vec<f32> = values.collect();
    sorted.sort_unstable_by(f32::total_cmp);
    if sorted.is_empty() {
        return vec![0.0; SIZE];
    }
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(sorted.iter().scan(0.0, |sum, value| {
            *sum += f64::from(*value);
            Some(*sum)
        }))
        .collect();
    let (low, high) = (f64::from(sorted[0]), f64::from(sorted[sorted.len() - 1]));
    let width = (high - low) / BINS as f64;
    let mut roots = vec![0.0; BINS];
    for value in &sorted {
        let bin = if width > 0.0 { ((f64::from(*value) - low) / width) as usize } else { 0 };
        roots[bin.min(BINS - 1)] += 1.0;
    }
    roots.iter_mut().for_each(|count: &mut f64| *count = count.cbrt());
    let step = roots.iter().sum::<f64>() / SIZE as f64;
    let mut book = Vec::with_capacity(SIZE);
    let mut passed = 0.0;
    for (bin, root) in roots.iter().enumerate() {
        while book.len() < SIZE && passed + root >= (book.len() as f64 + 0.5) * step {
            let part = ((book.len() as f64 + 0.5) * step - passed) / root;
            book.push(low + (bin as f64 + part) * width);
        }
        passed += root;
    }
    book.resize(SIZE, high);
    for _ in 0..ROUNDS {
        let mut from = 0;
        let ends: Vec<usize> = (0..SIZE)
            .map(|k| match book.get(k + 1) {
                Some(next) => sorted.partition_point(|value| f64::from(*value) <= 0.5 * (book[k] + next)),
                None => sorted.len(),
            })
            .collect();
        for (k, end) in ends.into_iter().enumerate() {
            if end > from {
                book[k] = (sums[end] - sums[from]) / (end - from) as f64;
            }
            from = from.max(end);
        }
    }
    book.into_iter().map(|value| value as f32).collect()
}

/// The number of a codebook that is nearest to a value.
pub(super) fn nearest(book: &[f32], value: f32) -> u8 {
    let above = book.partition_point(|entry| *entry < value).min(book.len() - 1);
    let below = above.saturating_sub(1);
    if value - book[below] <= book[above] - value { below as u8 } else { above as u8 }
}

/// Vectors that stand for all, and for each vector the number of its own.
#[derive(Debug, PartialEq)]
pub(super) struct Palette {
    /// Side by side.
    pub centres: Vec<f32>,
    pub labels: Vec<u32>,
}

/// A group of vectors on its way to be divided.
struct Group {
    /// Sum of squares about the mean, of all components.
    spread: f64,
    members: Vec<u32>,
    means: Vec<f64>,
    /// The component that varies most.
    widest: usize,
}

impl Group {
    fn new(vectors: &[f32], each: usize, members: Vec<u32>) -> Self {
        let (mut sums, mut squares) = (vec![0.0; each], vec![0.0; each]);
        for member in &members {
            let own = &vectors[each * *member as usize..][..each];
            for (k, value) in own.iter().enumerate() {
                sums[k] += f64::from(*value);
                squares[k] += f64::from(*value) * f64::from(*value);
            }
        }
        let count = members.len() as f64;
        let spreads: Vec<f64> =
            sums.iter().zip(&squares).map(|(sum, square)| (square - sum * sum / count).max(0.0)).collect();
        let widest = (0..each).max_by(|a, b| spreads[*a].total_cmp(&spreads[*b])).unwrap_or_default();
        let means = sums.into_iter().map(|sum| sum / count).collect();
        Self { spread: spreads.iter().sum(), members, means, widest }
    }
}

impl PartialEq for Group {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Group {}

impl PartialOrd for Group {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Group {
    fn cmp(&self, other: &Self) -> Ordering {
        self.spread.total_cmp(&other.spread).then_with(|| other.members.cmp(&self.members))
    }
}

/// A palette of at most `size` for vectors of `each` components: the group that is spread most is divided between two means of its
/// widest component, again and again.
pub(super) fn palette(vectors: &[f32], each: usize, size: usize) -> Palette {
    let count = vectors.len() / each;
    let mut open = BinaryHeap::new();
    open.push(Group::new(vectors, each, (0..count as u32).collect()));
    let mut done = Vec::new();
    while open.len() + done.len() < size {
        let Some(group) = open.pop() else { break };
        let at = group.widest;
        let value = |member: &u32| f64::from(vectors[each * *member as usize + at]);
        // Two means along the component, so that what lies close together stays so.
        let mut border = group.means[at];
        for _ in 0..BORDER_ROUNDS {
            let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
            for member in &group.members {
                let side = usize::from(value(member) > border);
                sums[side] += value(member);
                counts[side] += 1.0;
            }
            if counts[1] > 0.0 {
                border = 0.5 * (sums[0] / counts[0] + sums[1] / counts[1]);
            }
        }
        let is_low = |member: &u32| value(member) <= border;
        let (low, high): (Vec<u32>, Vec<u32>) = group.members.iter().partition(|member| is_low(member));
        if low.is_empty() || high.is_empty() {
            // All alike.
            done.push(group);
            continue;
        }
        open.extend([low, high].map(|members| Group::new(vectors, each, members)));
    }
    done.extend(open.into_sorted_vec());
    // In the order of their first member, which says nothing of how they came about.
    done.sort_by_key(|group| group.members.first().copied());
    let mut palette = Palette { centres: Vec::with_capacity(each * done.len()), labels: vec![0; count] };
    for (label, group) in (0u32..).zip(&done) {
        palette.centres.extend(group.means.iter().map(|mean| *mean as f32));
        group.members.iter().for_each(|member| palette.labels[*member as usize] = label);
    }
    palette
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, values would be given a number far from them though a nearer one is there.
    #[test]
    fn a_codebook_is_near_every_value() {
        let values: Vec<f32> = (0..5000).map(|i| (f64::from(i) * 0.37).sin() as f32 * (i % 7) as f32).collect();
        let book = codebook(values.iter().copied());
        assert!(book.is_sorted() && book.len() == SIZE);
        for value in &values {
            let found = (book[nearest(&book, *value) as usize] - value).abs();
            let least = book.iter().map(|entry| (entry - value).abs()).fold(f32::INFINITY, f32::min);
            assert!(found - least < 1e-6 && found < 0.1, "{value}: {found} and not {least}");
        }
        // As few as there are numbers come back as they were.
        let few = codebook([3.0, -1.0, 7.5].into_iter());
        for value in [3.0, -1.0, 7.5] {
            assert!((few[nearest(&few, value) as usize] - value).abs() < 1e-6, "{few:?}");
        }
    }

    /// If this failed, colours of one splat would be given to another, or a palette be no better than one colour for all.
    #[test]
    fn a_palette_tells_groups_apart() {
        let vector = |i: usize| [i % 5, i % 3].map(|v| v as f32 + 0.01 * (i as f32 * 0.7).sin());
        let vectors: Vec<f32> = (0..600).flat_map(vector).collect();
        let whole = palette(&vectors, 2, 15);
        assert_eq!(whole.centres.len(), 30);
        for (i, own) in vectors.chunks_exact(2).enumerate() {
            let centre = &whole.centres[2 * whole.labels[i] as usize..][..2];
            assert!(centre.iter().zip(own).all(|(a, b)| (a - b).abs() < 0.03), "{own:?} is {centre:?}");
        }
        // As many as there are vectors, and no more than differ.
        assert_eq!(palette(&[1.0, 1.0, 2.0, 1.0], 1, 9), Palette { centres: vec![1.0, 2.0], labels: vec![0, 0, 1, 0] });
    }
}
