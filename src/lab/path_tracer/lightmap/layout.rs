//! Where a light map has its cells: every side of a triangle is cut into patches, large ones into many, and these into equal cells
//! (Yuksel, Keyser and House 2010, "Mesh Colors"). The twin of `shaders/glsl/lab/path_tracer/lightmap.glsl`.

use glam::{DVec3, Vec3};

use crate::engine::parallel::in_parallel;
use crate::lab::path_tracer::assembly::Assembly;
use crate::lab::path_tracer::layout::{Patch, Side};
use crate::scene::random;
use crate::visibility::bvh::Triangle;
use crate::visibility::raycast::Ray;

/// Views by which sides of triangles are found to be seen, and the stream of their directions.
const VIEWS: usize = 1 << 18;
const VIEW_STREAM: u32 = 0x7669_6577;
/// Views that a large side has where as many look at it as at others; with fewer it is cut less finely, down to the least share.
const PLENTY: f64 = 0.25;
const MIN_DETAIL: f64 = 1.0 / 64.0;
/// Views that a side would usually have from which it says something that it has none.
const TELLING: f64 = 8.0;
/// Ratio of the square of the longest edge to four times the area from which a triangle counts as a sliver.
const SLIVER: f64 = 2.0;
/// Widths of a patch in the length of views, and most parts that edges are cut into: numbers of parts stay exact in single precision.
const PATCHES: f64 = 4.0;
const MAX_SPLITS: f64 = 64.0;
const MAX_ROWS: f64 = 2048.0;
/// Of the rays of a usual cell, what the smallest get, and hidden ones.
const MIN_SHARE: f32 = 1.0 / 8.0;
const HIDDEN_SHARE: f32 = 1.0 / 16.0;

/// Cells of a light map, in the order of the hierarchy's triangles.
pub(crate) struct Layout {
    pub sides: Vec<Side>,
    pub patches: Vec<Patch>,
    /// The patch of each cell.
    pub owners: Vec<u32>,
    /// By patch, whether it is large enough to be seen and is not.
    pub hidden: Vec<bool>,
    /// Corners of cells in all.
    pub corners: u32,
    /// Area of a usual cell.
    pub area: f64,
}

/// Area of a triangle, and that by which it is cut: slivers, whose parts are as long as they are, count for more.
fn areas_of(triangle: &Triangle) -> [f64; 2] {
    let [e1, e2] = [triangle.e1, triangle.e2].map(|e| Vec3::from(e).as_dvec3());
    let area = 0.5 * e1.cross(e2).length();
    let longest = e1.length().max(e2.length()).max(e1.distance(e2));
    [area, area.max((area * 0.5 * longest * longest / SLIVER).sqrt())]
}

impl Layout {
    /// About `cells` cells, at least one to each side of each triangle; where views from `eyes`, in the world, see little, there are few.
    pub fn new(assembly: &Assembly, cells: u32, eyes: &[DVec3]) -> Self {
        let views = Views::new(assembly, eyes);
        let mut layout = Self {
            sides: Vec::new(),
            patches: Vec::new(),
            owners: Vec::new(),
            hidden: Vec::new(),
            corners: 0,
            area: 0.0,
        };
        let mut areas = Vec::new();
        for (slot, triangle) in (0..).zip(&assembly.primitives) {
            let [area, wide] = areas_of(triangle);
            let splits = (PATCHES * wide.sqrt() / views.length).round().clamp(1.0, MAX_SPLITS) as u32;
            for side in [2 * slot, 2 * slot + 1] {
                layout.sides.push(Side { first: layout.patches.len() as u32, splits });
                layout.patches.extend((0..splits * splits).map(|_| Patch { side, ..Patch::default() }));
                let parts = f64::from(splits * splits);
                areas.extend((0..splits * splits).map(|_| [area / parts, wide / parts]));
            }
        }
        let seen = views.of(&layout);
        layout.divide(&areas, &seen, cells);
        layout
    }

    /// Cuts the patches into cells, by their areas and how many views meet each.
    fn divide(&mut self, areas: &[[f64; 2]], seen: &[u32], cells: u32) {
        // Views of a unit of area, as half of all views have it.
        let mut densities: Vec<(f64, u32)> = areas
            .iter()
            .zip(seen)
            .filter(|(_, seen)| **seen > 0)
            .map(|([area, _], seen)| (f64::from(*seen) / area.max(f64::MIN_POSITIVE), *seen))
            .collect();
        densities.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let half = seen.iter().map(|seen| u64::from(*seen)).sum::<u64>() / 2;
        let mut sum = 0;
        let median = densities.iter().find(|(_, seen)| {
            sum += u64::from(*seen);
            sum >= half
        });
        let usual = median.map_or(0.0, |(density, _)| *density);
        let detailed = |([area, wide], seen): (&[f64; 2], &u32)| {
            let expected = usual * area;
            // What is too small to be met by a view for sure counts as seen.
            let certain = (expected / TELLING).min(1.0);
            let detail = if expected > 0.0 { (f64::from(*seen) / (PLENTY * expected)).min(1.0) } else { 1.0 };
            wide * (1.0 - certain * (1.0 - detail)).max(MIN_DETAIL)
        };
        self.hidden = areas.iter().zip(seen).map(|([area, _], seen)| *seen == 0 && usual * area >= TELLING).collect();
        let weighted: Vec<f64> = areas.iter().zip(seen).map(detailed).collect();
        let rows = |weighted: f64, area: f64| (weighted / area).sqrt().round().clamp(1.0, MAX_ROWS);
        let count = |area: f64| weighted.iter().map(|weighted| rows(*weighted, area).powi(2)).sum::<f64>();
        // A mesh of many triangles has a cell for each side of them all; what is large is cut finely nonetheless.
        let most = f64::from(cells).max(weighted.len() as f64 + 0.5 * f64::from(cells));
        // The number of cells falls with their area.
        let [mut small, mut large] = [1e-12, 1.0].map(|part| part * weighted.iter().sum::<f64>());
        for _ in 0..60 {
            let area = (small * large).sqrt();
            if count(area) > most { small = area } else { large = area }
        }
        self.area = large;
        for (index, patch) in self.patches.iter_mut().enumerate() {
            let rows = rows(weighted[index], self.area) as u32;
            let share = match self.hidden[index] {
                true => HIDDEN_SHARE,
                false => ((areas[index][0] / self.area) as f32 / (rows * rows) as f32).clamp(MIN_SHARE, 1.0),
            };
            *patch = Patch { cells: self.owners.len() as u32, corners: self.corners, rows, share, side: patch.side };
            self.owners.extend(std::iter::repeat_n(index as u32, (rows * rows) as usize));
            self.corners += (rows + 1) * (rows + 2) / 2;
        }
    }

    /// Bytes of the buffers that photographs need.
    pub fn footprint(&self) -> [(&'static str, u64); 4] {
        [
            ("sides", size_of_val(&self.sides[..]) as u64),
            ("patches", size_of_val(&self.patches[..]) as u64),
            ("cells", 16 * self.owners.len() as u64),
            ("corners", 16 * u64::from(self.corners)),
        ]
    }
}

/// What views in all directions meet: the side and the weights of its second and third corner.
struct Views {
    met: Vec<Option<(u32, [f32; 2])>>,
    /// Their median length.
    length: f64,
}

impl Views {
    fn new(assembly: &Assembly, eyes: &[DVec3]) -> Self {
        let mut slots = vec![0u32; assembly.primitives.len()];
        for (slot, triangle) in (0..).zip(&assembly.primitives) {
            slots[triangle.index as usize] = slot;
        }
        let mut found = vec![None; VIEWS];
        in_parallel(&mut found, 1024, |chunk, found| {
            for (i, found) in found.iter_mut().enumerate() {
                let number = 1024 * chunk + i;
                let [u, v, ..] = random::uniforms(0, VIEW_STREAM, number as u32);
                let Some(eye) = eyes.get(number % eyes.len().max(1)) else { continue };
                let direction = random::direction(u, v).as_vec3();
                let origin = (*eye - assembly.centre).as_vec3();
                let hit = assembly.bvh.closest_hit(&Ray { origin, direction, t_min: 0.0, t_max: f32::MAX });
                let Some(hit) = hit else { continue };
                let slot = slots[hit.primitive as usize];
                let triangle = &assembly.primitives[slot as usize];
                let [v0, e1, e2] = [triangle.v0, triangle.e1, triangle.e2].map(Vec3::from);
                let normal = e1.cross(e2);
                let off = origin + hit.distance * direction - v0;
                let scale = normal.length_squared().max(f32::MIN_POSITIVE);
                let at = [off.cross(e2).dot(normal) / scale, e1.cross(off).dot(normal) / scale];
                *found = Some((2 * slot + u32::from(normal.dot(direction) > 0.0), at, hit.distance));
            }
        });
        let mut lengths: Vec<f32> = found.iter().flatten().map(|(_, _, length)| *length).collect();
        let half = lengths.len() / 2;
        let length = match lengths.is_empty() {
            true => f64::from(assembly.setting.radius),
            false => f64::from(*lengths.select_nth_unstable_by(half, f32::total_cmp).1),
        };
        let met = found.into_iter().map(|met| met.map(|(side, at, _)| (side, at))).collect();
        // Eyes may lie on a surface.
        Self { met, length: length.max(1e-3 * f64::from(assembly.setting.radius)) }
    }

    /// How many of them meet each patch.
    fn of(&self, layout: &Layout) -> Vec<u32> {
        let mut seen = vec![0; layout.patches.len()];
        for (side, at) in self.met.iter().flatten() {
            let Side { first, splits } = layout.sides[*side as usize];
            seen[(first + part_at(splits, *at).0) as usize] += 1;
        }
        seen
    }
}

/// The part of a triangle whose edges are cut into `rows` parts in which a place lies, by the weights of the second and third corner, and
/// the place in it.
pub(crate) fn part_at(rows: u32, at: [f32; 2]) -> (u32, [f32; 2]) {
    let [x, y] = at.map(|v| v.clamp(0.0, 1.0) * rows as f32);
    let j = (y as u32).min(rows - 1);
    let i = (x as u32).min(rows - 1 - j);
    let [x, y] = [x - i as f32, y - j as f32];
    let inverted = x + y > 1.0 && i + j + 1 < rows;
    (j * (2 * rows - j) + 2 * i + u32::from(inverted), if inverted { [1.0 - x, 1.0 - y] } else { [x, y] })
}

/// The place in the triangle of a place in one of its parts.
pub(crate) fn place_in_part(rows: u32, part: u32, [x, y]: [f32; 2]) -> [f32; 2] {
    let of = rows as f32;
    let mut j = ((of - (of * of - part as f32).max(0.0).sqrt()) as u32).min(rows - 1);
    // The root may be off by one.
    while j > 0 && j * (2 * rows - j) > part {
        j -= 1;
    }
    while (j + 1) * (2 * rows - j - 1) <= part {
        j += 1;
    }
    let along = part - j * (2 * rows - j);
    let [x, y] = if along & 1 != 0 { [1.0 - x, 1.0 - y] } else { [x, y] };
    [((along / 2) as f32 + x) / of, (j as f32 + y) / of]
}

/// Number of a corner of cells: the i-th in the j-th row.
pub(crate) fn corner_at(rows: u32, [i, j]: [u32; 2]) -> u32 {
    j * (2 * rows + 3 - j) / 2 + i
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::model::{Face, Vertex};
    use crate::scene::samples;
    use crate::scene::samples::textured::two_rooms_model;

    /// If this failed, rays would be added to one cell and read off another.
    #[test]
    fn places_in_a_cell_are_found_in_it() {
        for rows in [1, 2, 3, 7, 64, 500, 2047] {
            let all = rows * rows;
            for cell in (0..all).step_by((all as usize / 400).max(1)).chain([all - 1]) {
                for i in 0..8 {
                    let [u, v, ..] = random::bits(3, cell, i).map(random::uniform);
                    let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
                    // Places at a cell's very edge may be its neighbour's after rounding.
                    let [u, v] = [0.9 * u + 0.033, 0.9 * v + 0.033];
                    let at = place_in_part(rows, cell, [u, v]);
                    let (found, within) = part_at(rows, at);
                    assert_eq!(found, cell, "{rows} rows, {u} {v} at {at:?}");
                    let slack = 3e-7 * rows as f32;
                    assert!((within[0] - u).abs() < slack && (within[1] - v).abs() < slack, "{within:?}");
                    assert!(at[0] >= 0.0 && at[1] >= 0.0 && at[0] + at[1] <= 1.0 + 1e-6);
                }
            }
        }
        assert_eq!((part_at(5, [0.0, 1.0]).0, part_at(5, [1.0, 0.0]).0), (24, 8));
    }

    /// If this failed, a light map would be larger than asked for, triangles would share cells, or most cells lie where nobody looks.
    #[test]
    fn cells_are_about_as_many_as_asked_for_and_where_views_are() {
        let assembly = Assembly::new(&samples::object_model(), Some(&samples::studio())).unwrap();
        let least = 2 * assembly.primitives.len() as u32;
        let eyes = [3.0 * DVec3::X, -3.0 * DVec3::X, 3.0 * DVec3::Y, 3.0 * DVec3::Z, -3.0 * DVec3::Z];
        for cells in [0, 100_000, 400_000] {
            let layout = Layout::new(&assembly, cells, &eyes);
            let made = layout.owners.len() as f64;
            let patches = layout.patches.len() as f64;
            let wanted = f64::from(cells).max(patches + 0.5 * f64::from(cells));
            assert!((made / wanted - 1.0).abs() < 0.15, "{made} for {wanted}");
            assert!(layout.patches.len() < 2 * least as usize);
            let mut end = 0;
            for patch in &layout.patches {
                assert_eq!(patch.cells, end);
                end += patch.rows * patch.rows;
            }
            assert_eq!(end as usize, layout.owners.len());
        }
        // However many triangles there are, a wall among them is cut finely.
        let mut model = samples::object_model();
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| {
            model.vertices.push(Vertex { position: DVec3::new(4.0 * x, 4.0 * y, -3.0), ..Vertex::default() });
            model.vertices.len() as u32 - 1
        });
        let wall = [[0, 1, 2], [0, 2, 3]].map(|wall| wall.map(|corner: usize| corners[corner]));
        model.faces.extend(wall.map(|corners| Face { corners, material: 0 }));
        let assembly = Assembly::new(&model, Some(&samples::studio())).unwrap();
        let cells = assembly.primitives.len() as u32;
        let layout = Layout::new(&assembly, cells, &eyes);
        let most = layout.patches.iter().map(|patch| patch.rows).max();
        assert!(most >= Some(8), "{most:?} rows of cells on a wall");
        // Walls of rooms face in.
        let rooms = Assembly::new(&two_rooms_model(), None).unwrap();
        let layout = Layout::new(&rooms, 400_000, &[DVec3::new(1.5, 1.5, 3.0), DVec3::new(8.0, 1.5, 2.0)]);
        let of = |back: u32| {
            let own = layout.patches.iter().filter(|patch| patch.side % 2 == back);
            own.map(|patch| patch.rows.pow(2)).sum::<u32>()
        };
        assert!(of(0) > 2 * of(1), "{} cells on fronts, {} on backs, which nobody sees", of(0), of(1));
    }
}
