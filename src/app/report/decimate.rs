//! Fewer triangles for the page: vertices are merged by cells of a grid that grows until few enough are left (Rossignac
//! and Borrel 1993, "Multi-resolution 3D approximations for rendering complex scenes").

use std::collections::HashMap;

use glam::{DVec3, IVec3};

/// Corners and colours of at most `most` triangles that look like `corners`; all of them where there are no more.
pub(crate) fn decimate(corners: &[[DVec3; 3]], colours: &[[u8; 3]], most: usize) -> (Vec<[DVec3; 3]>, Vec<[u8; 3]>) {
    if corners.len() <= most {
        return (corners.to_vec(), colours.to_vec());
    }
    let all = corners.iter().flatten();
    let (min, max) =
        all.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(min, max), &corner| (min.min(corner), max.max(corner)));
    let mut cells = 512.0;
    loop {
        let cell = ((max - min).max_element() / cells).max(f64::MIN_POSITIVE);
        let (merged, colours) = merge(corners, colours, min, cell);
        if merged.len() <= most {
            return (merged, colours);
        }
        cells *= 0.8;
    }
}

fn merge(corners: &[[DVec3; 3]], colours: &[[u8; 3]], min: DVec3, cell: f64) -> (Vec<[DVec3; 3]>, Vec<[u8; 3]>) {
    let cell_of = |corner: DVec3| ((corner - min) / cell).floor().as_ivec3();
    // The first vertex of a cell represents all of them: it lies on the surface.
    let mut first: HashMap<IVec3, DVec3> = HashMap::new();
    for &corner in corners.iter().flatten() {
        first.entry(cell_of(corner)).or_insert(corner);
    }
    let mut seen = std::collections::HashSet::new();
    let (mut merged, mut kept) = (Vec::new(), Vec::new());
    for (i, triangle) in corners.iter().enumerate() {
        let cells = triangle.map(cell_of);
        let mut key = cells.map(|cell| cell.to_array());
        key.sort_unstable();
        if key[0] == key[1] || key[1] == key[2] || !seen.insert(key) {
            continue;
        }
        merged.push(cells.map(|cell| first[&cell]));
        kept.extend(colours.get(i));
    }
    (merged, kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A page with a million triangles does not open; one without any shows nothing.
    #[test]
    fn a_fine_sheet_keeps_its_extent_with_few_triangles() {
        let n = 300;
        let at = |x: usize, y: usize| DVec3::new(x as f64, y as f64, (x as f64 * 0.1).sin());
        let corners: Vec<[DVec3; 3]> = (0..n * n)
            .map(|i| (i % n, i / n))
            .flat_map(|(x, y)| [[at(x, y), at(x + 1, y), at(x, y + 1)], [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]])
            .collect();
        let colours = vec![[9, 8, 7]; corners.len()];
        let (few, their_colours) = decimate(&corners, &colours, 20_000);
        assert!((5_000..=20_000).contains(&few.len()), "{}", few.len());
        assert_eq!(few.len(), their_colours.len());
        let area = |t: &[DVec3; 3]| 0.5 * (t[1] - t[0]).cross(t[2] - t[0]).length();
        let (before, after): (f64, f64) = (corners.iter().map(area).sum(), few.iter().map(area).sum());
        assert!((after / before - 1.0).abs() < 0.05, "{before} {after}");
    }
}
