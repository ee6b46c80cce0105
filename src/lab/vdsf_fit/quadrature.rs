//! Points in the unit square for numerical integration.

/// `count` points of the Fibonacci lattice in [0, 1)^2: every strip and every area has its share of them.
pub(crate) fn lattice(count: usize) -> impl Iterator<Item = [f64; 2]> {
    const INVERSE_GOLDEN: f64 = 0.618_033_988_749_894_9;
    (0..count).map(move |i| {
        let turn = i as f64 * INVERSE_GOLDEN;
        [(i as f64 + 0.5) / count as f64, turn - turn.floor()]
    })
}
