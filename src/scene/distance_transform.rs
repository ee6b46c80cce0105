//! Exact Euclidean distance transform on a grid: Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled
//! Functions" (2012), one axis after the other, keeping the nearest site along with the distance.

/// For every cell the index of the nearest site (by centres; cells run x fastest), or `u32::MAX` where there is none at all.
pub(super) fn nearest_sites(dims: [u32; 3], is_site: impl Fn(usize) -> bool) -> Vec<u32> {
    let [nx, ny, nz] = dims.map(|n| n as usize);
    let cells = nx * ny * nz;
    // Indices fit 32 bits: three 32-bit dimensions whose product was allocated as a vector of sites.
    let mut sites: Vec<u32> = (0..cells).map(|i| if is_site(i) { i as u32 } else { u32::MAX }).collect();
    let mut squares: Vec<f32> = sites.iter().map(|s| if *s == u32::MAX { f32::INFINITY } else { 0.0 }).collect();
    let mut envelope = Envelope::new(nx.max(ny).max(nz));
    for (length, stride, lines) in [
        (nx, 1, Lines { inner: 1, outer: ny * nz, outer_stride: nx }),
        (ny, nx, Lines { inner: nx, outer: nz, outer_stride: nx * ny }),
        (nz, nx * ny, Lines { inner: nx * ny, outer: 1, outer_stride: cells }),
    ] {
        for outer in 0..lines.outer {
            for inner in 0..lines.inner {
                envelope.pass(&mut squares, &mut sites, outer * lines.outer_stride + inner, stride, length);
            }
        }
    }
    sites
}

/// The first cells of all lines along an axis: `outer * outer_stride + inner`.
struct Lines {
    inner: usize,
    outer: usize,
    outer_stride: usize,
}

/// Scratch of one line: the lower envelope of parabolas.
struct Envelope {
    /// Height of the parabola at each cell of the line, and its site.
    cells: Vec<(f32, u32)>,
    /// Cells whose parabolas make the envelope, and from where on each is the lowest.
    parabolas: Vec<(usize, f32)>,
}

impl Envelope {
    fn new(longest: usize) -> Self {
        Self { cells: Vec::with_capacity(longest), parabolas: Vec::with_capacity(longest) }
    }

    /// Replaces the squared distances and sites of one line by `min_q (x - q)² + f(q)` and the minimiser's site.
    fn pass(&mut self, squares: &mut [f32], sites: &mut [u32], start: usize, stride: usize, length: usize) {
        self.cells.clear();
        self.parabolas.clear();
        for q in 0..length {
            let (height, site) = (squares[start + q * stride], sites[start + q * stride]);
            self.cells.push((height, site));
            if height.is_infinite() {
                continue;
            }
            let mut from = f32::NEG_INFINITY;
            while let Some(&(p, p_from)) = self.parabolas.last() {
                // Squared distances and positions are integers below 2^24, so only the quotient is rounded.
                let rise = height - self.cells[p].0 + (q * q) as f32 - (p * p) as f32;
                let meet = rise / (2 * (q - p)) as f32;
                if meet > p_from {
                    from = meet;
                    break;
                }
                self.parabolas.pop();
            }
            self.parabolas.push((q, from));
        }
        if self.parabolas.is_empty() {
            return;
        }
        let mut lowest = 0;
        for x in 0..length {
            while self.parabolas.get(lowest + 1).is_some_and(|(_, from)| *from < x as f32) {
                lowest += 1;
            }
            let q = self.parabolas[lowest].0;
            let (height, site) = self.cells[q];
            squares[start + x * stride] = height + (x.abs_diff(q) * x.abs_diff(q)) as f32;
            sites[start + x * stride] = site;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    fn square(dims: [u32; 3], a: usize, b: usize) -> i64 {
        let [nx, ny, _] = dims.map(|n| n as i64);
        let of = |i: usize| [i as i64 % nx, i as i64 / nx % ny, i as i64 / (nx * ny)];
        let (a, b) = (of(a), of(b));
        (0..3).map(|k| (a[k] - b[k]).pow(2)).sum()
    }

    /// A site that is not the nearest makes the distance too large: cameras would be reported too far from the feasible region,
    /// and surfaces farther than they are.
    #[test]
    fn every_cell_finds_its_nearest_site() {
        for (seed, dims, density) in [
            (1, [17, 9, 13], 0.01),
            (2, [1, 20, 5], 0.1),
            (3, [8, 8, 8], 0.5),
            (4, [30, 1, 1], 0.1),
            (5, [12, 12, 12], 0.002),
        ] {
            let cells = dims.iter().product::<u32>() as usize;
            let sites: Vec<bool> =
                (0..cells).map(|i| i == 5 || random::uniforms(seed, 0, i as u32)[0] < density).collect();
            let nearest = nearest_sites(dims, |i| sites[i]);
            for i in 0..cells {
                let best = (0..cells).filter(|j| sites[*j]).map(|j| square(dims, i, j)).min().unwrap();
                assert!(sites[nearest[i] as usize]);
                assert_eq!(square(dims, i, nearest[i] as usize), best, "cell {i} of {dims:?}");
            }
        }
    }

    /// Without any site there is no distance to report.
    #[test]
    fn no_site_means_no_nearest() {
        assert!(nearest_sites([3, 4, 5], |_| false).iter().all(|s| *s == u32::MAX));
    }
}
