//! One-to-one assignment: which photo replaces which planned camera, so that the sum of distances is least.

/// For each row the column that it gets, all different, with the least sum of `cost(row, column)`: the Hungarian method by
/// shortest augmenting paths (Jonker and Volgenant, "A shortest augmenting path algorithm for dense and sparse linear
/// assignment problems", 1987). Costs are finite; at least as many columns as rows. Ties go to the lower column.
pub(crate) fn assign(rows: usize, columns: usize, cost: impl Fn(usize, usize) -> f64) -> Vec<usize> {
    const NONE: usize = usize::MAX;
    let (mut row_price, mut column_price) = (vec![0.0; rows], vec![0.0; columns]);
    let mut owner = vec![NONE; columns];
    for row in 0..rows {
        // Dijkstra over columns, from `row` to the nearest unassigned column.
        let mut shortest = vec![f64::INFINITY; columns];
        let mut reached_from = vec![NONE; columns];
        let mut settled = vec![false; columns];
        let (mut at_row, mut at_column, mut length) = (row, NONE, 0.0);
        loop {
            let mut next = (f64::INFINITY, NONE);
            for column in 0..columns {
                if settled[column] {
                    continue;
                }
                let through = length + cost(at_row, column) - row_price[at_row] - column_price[column];
                if through < shortest[column] {
                    shortest[column] = through;
                    reached_from[column] = at_column;
                }
                if shortest[column] < next.0 || next.1 == NONE {
                    next = (shortest[column], column);
                }
            }
            (length, at_column) = next;
            settled[at_column] = true;
            if owner[at_column] == NONE {
                break;
            }
            at_row = owner[at_column];
        }
        row_price[row] += length;
        for column in (0..columns).filter(|column| settled[*column] && *column != at_column) {
            let slack = length - shortest[column];
            row_price[owner[column]] += slack;
            column_price[column] -= slack;
        }
        // Assign every column on the path to the row that reached it.
        loop {
            let before = reached_from[at_column];
            owner[at_column] = if before == NONE { row } else { owner[before] };
            if before == NONE {
                break;
            }
            at_column = before;
        }
    }
    let mut assigned = vec![NONE; rows];
    for (column, row) in owner.into_iter().enumerate().filter(|(_, row)| *row != NONE) {
        assigned[row] = column;
    }
    assigned
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// The least sum over all ways to give rows different columns.
    fn brute_force(rows: usize, columns: usize, cost: &dyn Fn(usize, usize) -> f64, taken: u32) -> f64 {
        if rows == 0 {
            return 0.0;
        }
        let free = (0..columns).filter(|column| taken >> column & 1 == 0);
        free.map(|column| cost(rows - 1, column) + brute_force(rows - 1, columns, cost, taken | 1 << column))
            .fold(f64::INFINITY, f64::min)
    }

    /// If this failed, photos far from where cameras were planned would be taken, or one photo twice.
    #[test]
    fn the_assignment_is_the_cheapest_of_all() {
        for seed in 0..60 {
            let (rows, columns) = (1 + seed as usize % 5, 5 + seed as usize % 3);
            let cost = |row: usize, column: usize| {
                let draw = random::uniforms(seed, row as u32, column as u32)[0];
                // Coarse costs make ties.
                if seed % 2 == 0 { draw } else { (4.0 * draw).floor() }
            };
            let assigned = assign(rows, columns, cost);
            let mut distinct = assigned.clone();
            distinct.sort_unstable();
            distinct.dedup();
            assert_eq!(distinct.len(), rows, "a photo twice: {assigned:?}");
            let sum: f64 = assigned.iter().enumerate().map(|(row, column)| cost(row, *column)).sum();
            let least = brute_force(rows, columns, &cost, 0);
            assert!((sum - least).abs() < 1e-12, "seed {seed}: {sum}, not {least}");
        }
        assert_eq!(assign(0, 3, |_, _| 0.0), Vec::<usize>::new());
    }
}
