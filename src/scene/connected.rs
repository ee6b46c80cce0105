//! Voxels that are connected through their faces.

use glam::DVec3;

use super::voxels::Grid;

/// Where one gets from free space without crossing the surface or a limit.
pub struct Air {
    grid: Grid,
    reached: Vec<bool>,
}

impl Air {
    /// What is connected with the voxels `from` through faces of open ones.
    pub(super) fn new(grid: Grid, from: impl Iterator<Item = usize>, open: impl Fn(usize) -> bool) -> Self {
        let mut reached = vec![false; grid.voxels()];
        let mut next: Vec<usize> = from.collect();
        next.iter().for_each(|i| reached[*i] = true);
        while let Some(i) = next.pop() {
            for side in sides(&grid, i).into_iter().flatten() {
                if !reached[side] && open(side) {
                    reached[side] = true;
                    next.push(side);
                }
            }
        }
        Self { grid, reached }
    }

    /// Whether `p` is in the open; whatever is outside of the grid is as the nearest place within.
    pub fn holds(&self, p: DVec3) -> bool {
        self.reached[self.grid.index(self.grid.voxel(p))]
    }
}

/// Indices, in rising order, of the open voxels that are connected through faces with one of `from`.
pub(super) fn connected_with(grid: &Grid, open: &[bool], from: impl Iterator<Item = usize>) -> Vec<u32> {
    let air = Air::new(*grid, from.filter(|i| open[*i]), |i| open[i]);
    (0..).zip(air.reached).filter(|(_, reached)| *reached).map(|(i, _)| i).collect()
}

/// Indices of the set of open voxels connected through faces that counts most, in rising order; of equals the first.
pub(super) fn best_component(grid: &Grid, open: &[bool], count: impl Fn(&[u32]) -> usize) -> Vec<u32> {
    let mut unseen = open.to_vec();
    let (mut best, mut most) = (Vec::new(), 0);
    for start in 0..open.len() {
        if !unseen[start] {
            continue;
        }
        unseen[start] = false;
        let mut component = vec![start as u32];
        let mut next = 0;
        while next < component.len() {
            let i = component[next] as usize;
            next += 1;
            for j in sides(grid, i).into_iter().flatten() {
                if unseen[j] {
                    unseen[j] = false;
                    component.push(j as u32);
                }
            }
        }
        let counted = count(&component);
        if counted > most {
            (best, most) = (component, counted);
        }
    }
    best.sort_unstable();
    best
}

/// The voxels that share a face with one.
fn sides(grid: &Grid, i: usize) -> [Option<usize>; 6] {
    let [nx, ny, nz] = grid.dims.map(|n| n as usize);
    let (x, y, z) = (i % nx, i / nx % ny, i / (nx * ny));
    [
        (x > 0).then(|| i - 1),
        (x + 1 < nx).then_some(i + 1),
        (y > 0).then(|| i - nx),
        (y + 1 < ny).then_some(i + nx),
        (z > 0).then(|| i - nx * ny),
        (z + 1 < nz).then_some(i + nx * ny),
    ]
}
