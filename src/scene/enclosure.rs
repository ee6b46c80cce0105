//! What a room encloses, of a box that reaches beyond its walls.

use glam::DVec3;

use super::connected::best_component;
use super::voxels::Grid;

/// So many of the six ways along the axes end on a surface in a room: a window, a door or an open ceiling may be missing; and
/// at least so many where something else is.
const ENCLOSED: u8 = 5;
const INSIDE: u8 = 4;
/// Part of a space that is enclosed from which on it is that of a room, and the rest is what lies beyond its walls.
const ROOM: f64 = 1.0 / 3.0;
/// Part of the grid from which on something enclosed may be a room: furniture is smaller.
const LEAST: f64 = 0.005;

/// What walls enclose of a box.
#[derive(Debug, PartialEq)]
enum Enclosure {
    /// Nothing, or all of the space.
    All,
    /// A room: for every voxel, whether it lies inside.
    Room(Vec<bool>),
    /// The voxels of what may be one, while the space lies mostly beyond it.
    Elsewhere(Vec<u32>),
}

impl Enclosure {
    /// Of a connected `space` among the `open` voxels; the surface touches those that are `occupied`.
    fn of(grid: &Grid, occupied: &[bool], open: &[bool], space: &[u32]) -> Self {
        let sides = sides_that_end(grid, occupied);
        let with = |least: u8| space.iter().filter(|i| sides[**i as usize] >= least).count();
        if with(ENCLOSED) as f64 >= ROOM * space.len() as f64 {
            let all = with(INSIDE) == space.len();
            return if all { Self::All } else { Self::Room(sides.iter().map(|count| *count >= INSIDE).collect()) };
        }
        let enclosed: Vec<bool> = open.iter().zip(&sides).map(|(open, count)| *open && *count >= ENCLOSED).collect();
        let largest = best_component(grid, &enclosed, |some| some.len());
        let may_be_a_room = largest.len() as f64 >= LEAST * grid.voxels() as f64;
        if may_be_a_room { Self::Elsewhere(largest) } else { Self::All }
    }
}

/// The space that cameras and viewers get.
pub(super) struct Indoors {
    /// Its voxels, rising.
    pub(super) space: Vec<u32>,
    /// Fraction of the space without walls that lies beyond them.
    pub(super) beyond: f64,
    /// Lowest and highest corner of what may be a room, where the space is not in it.
    pub(super) elsewhere: Option<[DVec3; 2]>,
}

impl From<Vec<u32>> for Indoors {
    fn from(space: Vec<u32>) -> Self {
        Self { space, beyond: 0.0, elsewhere: None }
    }
}

/// Of the connected spaces among the `open` voxels the one that counts most, within the walls of a room where there is one: what is beyond
/// them is no longer open then. `seen` are the voxels that a surface which somebody saw touches.
pub(super) fn indoors(grid: &Grid, seen: &[bool], open: &mut [bool], count: impl Fn(&[u32]) -> usize) -> Indoors {
    let all = best_component(grid, open, &count);
    match Enclosure::of(grid, seen, open, &all) {
        Enclosure::All => all.into(),
        Enclosure::Room(inside) => {
            let outside = all.iter().filter(|i| !inside[**i as usize]).count();
            open.iter_mut().zip(inside).for_each(|(open, inside)| *open &= inside);
            let space = best_component(grid, open, count);
            Indoors { space, beyond: outside as f64 / all.len() as f64, elsewhere: None }
        }
        Enclosure::Elsewhere(room) => {
            let centres = || room.iter().map(|i| grid.centre(grid.coordinates(*i as usize)));
            let (low, high) =
                (centres().fold(DVec3::INFINITY, DVec3::min), centres().fold(DVec3::NEG_INFINITY, DVec3::max));
            Indoors { space: all, beyond: 0.0, elsewhere: Some([low, high]) }
        }
    }
}

/// For every voxel, how many of the six ways along the axes meet an occupied voxel within the grid.
fn sides_that_end(grid: &Grid, occupied: &[bool]) -> Vec<u8> {
    let mut count = vec![0; grid.voxels()];
    let dims = grid.dims.map(|n| n as usize);
    let strides = [1, dims[0], dims[0] * dims[1]];
    for axis in 0..3 {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        for first in (0..dims[v]).flat_map(|j| (0..dims[u]).map(move |i| i * strides[u] + j * strides[v])) {
            let mut sweep = |along: &mut dyn Iterator<Item = usize>| {
                let mut met = false;
                for voxel in along.map(|k| first + k * strides[axis]) {
                    count[voxel] += u8::from(met);
                    met |= occupied[voxel];
                }
            };
            sweep(&mut (0..dims[axis]));
            sweep(&mut (0..dims[axis]).rev());
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of 24 by 24 by 12 voxels with walls one voxel thick around an L, the corner beyond (12, 12) cut out.
    fn room(ceiling: bool) -> (Grid, Vec<bool>) {
        let grid = Grid { origin: DVec3::ZERO, cell: 1.0, dims: [24, 24, 12] };
        let within = |x: u32, y: u32| (2..22).contains(&x) && (2..22).contains(&y) && (x < 12 || y < 12);
        let occupied = (0..grid.voxels()).map(|i| {
            let [x, y, z] = grid.coordinates(i);
            let beside = [(x - 1.min(x), y), (x + 1, y), (x, y - 1.min(y)), (x, y + 1)];
            let wall = !within(x, y) && beside.iter().any(|(x, y)| within(*x, *y));
            // A door into the corner that is cut out.
            let door = (4..6).contains(&y.wrapping_sub(12)) && x == 12 && z < 8;
            (wall && !door && (1..11).contains(&z)) || (within(x, y) && (z == 1 || (ceiling && z == 10)))
        });
        (grid, occupied.collect())
    }

    /// If this failed, cameras would stand outside of the house, or a part of the room would be taken for outside.
    #[test]
    fn what_lies_beyond_the_walls_is_no_room() {
        for ceiling in [true, false] {
            let (grid, occupied) = room(ceiling);
            let space: Vec<u32> = (0..grid.voxels() as u32).filter(|i| !occupied[*i as usize]).collect();
            let open: Vec<bool> = occupied.iter().map(|occupied| !occupied).collect();
            let Enclosure::Room(inside) = Enclosure::of(&grid, &occupied, &open, &space) else { panic!("a room") };
            // Walls are as high as the ceiling is thick.
            let top = if ceiling { 10 } else { 11 };
            for i in space {
                let [x, y, z] = grid.coordinates(i as usize);
                let room = (2..22).contains(&x) && (2..22).contains(&y) && (x < 12 || y < 12) && (2..top).contains(&z);
                // The frame of the door is neither.
                let door = x == 12 && y < 12 + 6;
                assert!(door || inside[i as usize] == room, "({x}, {y}, {z})");
            }
        }
    }

    /// If this failed, cameras around a thing, or in a street, would be taken for outside.
    #[test]
    fn a_space_without_walls_is_no_room() {
        let grid = Grid { origin: DVec3::ZERO, cell: 1.0, dims: [24, 24, 12] };
        let thing = |[x, y, z]: [u32; 3]| (8..16).contains(&x) && (8..16).contains(&y) && z < 8;
        let street = |[x, _, z]: [u32; 3]| z == 0 || !(6..18).contains(&x);
        // A house in a wide field, with a room in it: who asks for a room may mean that.
        let within = |[x, y, z]: [u32; 3], edge: u32| {
            (8 + edge..14 - edge).contains(&x) && (8 + edge..14 - edge).contains(&y) && (edge..6 - edge).contains(&z)
        };
        let house = |voxel: [u32; 3]| within(voxel, 0) && !within(voxel, 1);
        for (scene, room) in [(&thing as &dyn Fn([u32; 3]) -> bool, 0), (&street, 0), (&house, 4 * 4 * 4)] {
            let occupied: Vec<bool> = (0..grid.voxels()).map(|i| scene(grid.coordinates(i))).collect();
            let open: Vec<bool> = occupied.iter().map(|occupied| !occupied).collect();
            let space = best_component(&grid, &open, |some| some.len());
            match Enclosure::of(&grid, &occupied, &open, &space) {
                Enclosure::All => assert_eq!(room, 0),
                Enclosure::Room(_) => panic!("no room"),
                Enclosure::Elsewhere(found) => assert_eq!(found.len(), room),
            }
        }
    }
}
