//! Single rooms with few things in them, with many, and with so many that one has to walk around them; a long one, a small one, and one
//! between whose shelves one walks. What stands where is drawn at random, and is always the same.

use glam::{DAffine3, DVec3};

use super::cabinets::{chest, door, shelf, stack_of_books, table, wardrobe};
use super::fittings::{ceiling_lamp, curtains, pendant, picture, radiator, rug, standing_lamp, window};
use super::furnisher::{APART, Finish, Furnisher, Gloss};
use super::palette::{BLUE_GLAZE, CLAY, CREAM_GLAZE, DARK_WOOD, GRAPHITE, OAK, OATMEAL, SAGE, WALNUT, WHITE};
use super::rooms::wall;
use super::seats::{bed, chair, pouffe, sofa};
use super::texture::Texture;
use super::things::{bowl, cup, desk_lamp, fruit, keyboard, monitor, plant, plate, twigs, vase};
use crate::scene::model::Model;
use crate::scene::random;

/// Height of the ceiling, and of the upper edge of the window.
const HEIGHT: f64 = 2.6;
/// Middle of the window above the floor, and half its size.
const WINDOW: (f64, [f64; 2]) = (1.52, [0.9, 0.62]);
/// Tries to find a place for a thing.
const TRIES: u32 = 200;
const SEED: u64 = 0x6675_726e;

const FLOOR: Finish = Finish::of(Texture::Planks).with(Gloss::Varnished);
const CEILING: Finish = Finish::of(Texture::Plaster).tinted(250, 248, 244);
const PAPERED: Finish = Finish::of(Texture::Wallpaper);

/// Single rooms, by what stands in them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SingleRoom {
    /// 5 m by 4, with a few things along the walls.
    Bare,
    /// 6 m by 5, with things along the walls and in the middle.
    Furnished,
    /// 7.5 m by 6, with things wherever there is a place, as in a junk shop.
    Crowded,
    /// 10 m by 2.8, with things along the walls and a few between them.
    Long,
    /// 8 m by 6, with shelves and a few desks along the walls, shelves across the floor, and a table.
    Library,
    /// 3.4 m by 3, with the walls full.
    Small,
}

/// How much stands in a room.
struct Measure {
    /// Its size along x and z, in metres.
    size: [f64; 2],
    /// Share of the walls with something in front of it, and what may stand there.
    covered: f64,
    before_a_wall: &'static [Thing],
    /// Things that stand free.
    free: u32,
    /// Space around each of these, in metres.
    apart: f64,
    /// Each so many of them is a shelf.
    shelf_every: u32,
    /// Colour of the walls.
    plaster: [u8; 3],
}

impl SingleRoom {
    fn measure(self) -> Measure {
        let of = |size, covered, free, apart, shelf_every, plaster| Measure {
            size,
            covered,
            before_a_wall: if self == Self::Library { &OF_A_LIBRARY } else { &BEFORE_A_WALL },
            free,
            apart,
            shelf_every,
            plaster,
        };
        match self {
            Self::Bare => of([5.0, 4.0], 0.3, 1, 0.7, 3, [226, 216, 200]),
            Self::Furnished => of([6.0, 5.0], 0.65, 6, 0.45, 3, [206, 212, 212]),
            Self::Crowded => of([7.5, 6.0], 0.95, 40, 0.2, 3, [214, 190, 164]),
            Self::Long => of([10.0, 2.8], 0.5, 8, 0.5, 3, [200, 208, 190]),
            Self::Library => of([8.0, 6.0], 0.9, 14, 0.75, 1, [222, 210, 186]),
            Self::Small => of([3.4, 3.0], 0.8, 3, 0.25, 3, [210, 200, 214]),
        }
    }
}

/// Short for places.
fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A room with a door and a window, lit by this and by lamps; +Y up, in metres, a corner of the floor at 0.
pub fn furnished_room(room: SingleRoom) -> Model {
    let mut model = Model::default();
    let mut add = Furnisher::new(&mut model, DAffine3::IDENTITY);
    let Measure { size, covered, before_a_wall, free, apart, shelf_every, plaster: [r, g, b] } = room.measure();
    shell(&mut add, size, Finish::of(Texture::Plaster).tinted(r, g, b));
    let mut places = Places { draws: room as u32 * 100_000, size, taken: Vec::new(), apart };
    along_walls(&mut add, &mut places, covered, before_a_wall);
    for number in 0..free {
        standing_free(&mut add, &mut places, number, shelf_every);
    }
    for i in 0..3 {
        let at = v(size[0] * (f64::from(i) + 0.5) / 3.0, HEIGHT, 0.5 * size[1]);
        match i {
            1 if room == SingleRoom::Crowded => add.at(at - v(0.0, APART, 0.0), 0.0, |add| pendant(add, 0.6)),
            1 => {}
            _ => add.at(at, 0.0, |add| ceiling_lamp(add, 0.42)),
        }
    }
    model
}

/// Floor, ceiling and walls; a window in the middle of the wall z = 0, a door at the end of the one across.
fn shell(add: &mut Furnisher, [wide, deep]: [f64; 2], plaster: Finish) {
    let (right, back, up) = (v(wide, 0.0, 0.0), v(0.0, 0.0, deep), v(0.0, HEIGHT, 0.0));
    add.sheet(back, [right, -back], FLOOR);
    add.sheet(up, [right, back], CEILING);
    let (y, [a, b]) = WINDOW;
    let x = 0.5 * wide;
    wall(add, DVec3::ZERO, right, [x - a, y - b], [x + a, y + b], plaster);
    add.sheet(right + back, [-right, up], plaster);
    add.sheet(back, [-back, up], PAPERED);
    add.sheet(right, [back, up], plaster);
    add.at(v(x, y, 0.0), 0.0, |add| window(add, [a, b], [0.1, 0.7]));
    add.at(v(x, 0.0, 0.0), 0.0, |add| {
        curtains(add, [a - 0.02, a + 0.4], [0.04, 2.36]);
        radiator(add, 0.6, 0.64);
    });
    add.at(v(0.7, 0.0, deep), 180.0, door);
}

/// Random numbers in a fixed order, and the parts of the floor that are taken: middles and half sizes along x and z.
struct Places {
    draws: u32,
    size: [f64; 2],
    taken: Vec<([f64; 2], [f64; 2])>,
    apart: f64,
}

impl Places {
    fn draw(&mut self) -> [f64; 4] {
        self.draws += 1;
        random::uniforms(SEED, 0, self.draws)
    }

    /// Whether something of this half size at `middle` is within the room and has space around it.
    fn is_free(&self, middle: [f64; 2], half: [f64; 2], apart: f64) -> bool {
        let inside = (0..2).all(|k| middle[k] - half[k] >= 0.02 && middle[k] + half[k] <= self.size[k] - 0.02);
        let clear = |(other, size): &([f64; 2], [f64; 2])| {
            (0..2).any(|k| (middle[k] - other[k]).abs() > half[k] + size[k] + apart)
        };
        inside && self.taken.iter().all(clear)
    }
}

/// Things in front of the walls until so much of them is covered, and pictures above where there is a place.
fn along_walls(add: &mut Furnisher, places: &mut Places, share: f64, things: &[Thing]) {
    let [wide, deep] = places.size;
    // The door, and what stands below the window.
    places.taken.push(([0.7, deep - 0.4], [0.5, 0.4]));
    places.taken.push(([0.5 * wide, 0.1], [1.3, 0.1]));
    // Where each wall begins, the angle that it faces, and its length to the right as one looks at it.
    let walls = [
        (v(0.0, 0.0, 0.0), 0.0, wide),
        (v(wide, 0.0, deep), 180.0, wide),
        (v(0.0, 0.0, deep), 90.0, deep),
        (v(wide, 0.0, 0.0), 270.0, deep),
    ];
    for (corner, degrees, length) in walls {
        let along = DAffine3::from_rotation_y(f64::to_radians(degrees)).transform_vector3(DVec3::X);
        let inward = along.cross(DVec3::Y);
        let mut covered = 0.0;
        for _ in 0..TRIES {
            if covered > share * length {
                break;
            }
            let [which, at, turn, _] = places.draw();
            let thing = things[(which * things.len() as f64) as usize];
            let [half, depth] = thing.half;
            let middle = corner + (half + at * (length - 2.0 * half).max(0.0)) * along + (depth + 0.03) * inward;
            let extent = if along.x.abs() > 0.5 { [half, depth] } else { [depth, half] };
            if 2.0 * half > length || !places.is_free([middle.x, middle.z], extent, 0.08) {
                continue;
            }
            places.taken.push(([middle.x, middle.z], extent));
            covered += 2.0 * half;
            let number = (turn * 1000.0) as u32;
            add.at(middle, degrees, |add| (thing.make)(add, number, 0.0));
            let above = corner + (middle - corner).dot(along) * along + v(0.0, 1.62, 0.0);
            let beside_the_window = (above - v(0.5 * wide, 0.0, 0.0)).length() > 2.4;
            if thing.low && beside_the_window {
                add.at(above, degrees, |add| picture(add, [0.34, 0.3], 0.04, number % 9, OAK));
            }
        }
    }
}

/// A thing that is placed by its extent.
#[derive(Clone, Copy)]
struct Thing {
    /// Half its size across and deep.
    half: [f64; 2],
    /// Whether a picture may hang above it.
    low: bool,
    /// Makes it around the origin, its back at -Z, by a number for what it holds, and turned where it is round, in degrees.
    make: fn(&mut Furnisher, u32, f64),
}

/// Short for things.
const fn thing(half: [f64; 2], low: bool, make: fn(&mut Furnisher, u32, f64)) -> Thing {
    Thing { half, low, make }
}

/// Things whose backs are to a wall.
const BEFORE_A_WALL: [Thing; 6] = [
    SHELF,
    thing([0.7, 0.32], false, |add, number, _| wardrobe(add, [SAGE, WHITE, OAK][number as usize % 3])),
    thing([0.55, 0.23], true, drawers),
    thing([1.15, 0.48], true, |add, _, _| sofa(add)),
    thing([0.85, 1.02], false, |add, _, _| bed(add)),
    DESK,
];
const OF_A_LIBRARY: [Thing; 3] = [SHELF, SHELF, DESK];
const DESK: Thing = thing([0.8, 0.37], true, desk);

/// Things that can be walked around: a table, what hides what is behind it, and what stands between them.
const TABLE: Thing = thing([1.0, 0.85], false, |add, number, _| laid_table(add, number));
const SHELF: Thing = thing([0.9, 0.2], false, bookshelf);
const BETWEEN: [Thing; 6] = [
    thing([0.3, 0.3], true, |add, _, degrees| add.at(DVec3::ZERO, degrees, pouffe)),
    thing([0.45, 0.45], false, |add, _, degrees| add.at(DVec3::ZERO, degrees, plant)),
    thing([0.22, 0.22], false, |add, _, _| standing_lamp(add, 1.5, 0.19, GRAPHITE)),
    thing([0.28, 0.28], true, |add, _, degrees| add.at(DVec3::ZERO, degrees, chair)),
    thing([0.6, 0.45], true, low_chest),
    thing([0.25, 0.25], true, |add, number, _| {
        stack_of_books(add, [0.3, 0.24], &[0.06, 0.05, 0.05, 0.04, 0.04, 0.03], number);
    }),
];

fn bookshelf(add: &mut Furnisher, number: u32, _: f64) {
    shelf(add, |add, free| match free % 3 {
        0 => vase(add, 0.22, CLAY),
        1 => stack_of_books(add, [0.2, 0.15], &[0.035, 0.028, 0.024], number),
        _ => bowl(add, 0.1, BLUE_GLAZE),
    });
}

fn drawers(add: &mut Furnisher, number: u32, _: f64) {
    chest(add, v(1.1, 0.84, 0.42), 3, [WHITE, WALNUT, OAK][number as usize % 3]);
    add.at(v(-0.3, 0.842, 0.0), 0.0, |add| {
        vase(add, 0.26, CREAM_GLAZE);
        add.at(v(0.0, 0.17, 0.0), 40.0, |add| twigs(add, 0.38, 4));
    });
    add.at(v(0.2, 0.842, 0.03), 60.0, |add| stack_of_books(add, [0.22, 0.16], &[0.03, 0.036, 0.022], number));
}

fn desk(add: &mut Furnisher, number: u32, _: f64) {
    table(add, v(1.6, 0.75, 0.7), WALNUT);
    add.at(v(0.02, 0.75, -0.12), 0.0, monitor);
    add.at(v(0.02, 0.75, 0.16), 0.0, keyboard);
    add.at(v(-0.6, 0.75, -0.1), 10.0, desk_lamp);
    add.at(v(0.56, 0.752, 0.0), 84.0, |add| stack_of_books(add, [0.24, 0.18], &[0.036, 0.028, 0.03], number));
}

fn low_chest(add: &mut Furnisher, _: u32, degrees: f64) {
    chest(add, v(1.1, 0.6, 0.8), 2, DARK_WOOD);
    add.at(v(0.1, 0.602, 0.0), degrees, |add| bowl(add, 0.14, CLAY));
    add.at(v(-0.3, 0.602, 0.1), degrees, |add| vase(add, 0.3, BLUE_GLAZE));
}

/// A thing that can be walked around, where there is a place for it.
fn standing_free(add: &mut Furnisher, places: &mut Places, number: u32, shelf_every: u32) {
    let [which, turn, books, _] = places.draw();
    // The first is a table with chairs; a shelf hides what is behind it.
    let thing = match number {
        0 => TABLE,
        number if number.is_multiple_of(shelf_every) => SHELF,
        _ => BETWEEN[(which * BETWEEN.len() as f64) as usize],
    };
    let quarter = (turn * 4.0) as u32 % 2;
    let half = if quarter == 1 { [thing.half[1], thing.half[0]] } else { thing.half };
    for _ in 0..TRIES {
        let [x, z, ..] = places.draw();
        let middle = [x * places.size[0], z * places.size[1]];
        if !places.is_free(middle, half, places.apart) {
            continue;
        }
        places.taken.push((middle, half));
        let number = (1000.0 * books) as u32;
        add.at(v(middle[0], 0.0, middle[1]), 90.0 * f64::from(quarter), |add| (thing.make)(add, number, 360.0 * turn));
        return;
    }
}

/// A table with two chairs on a rug.
fn laid_table(add: &mut Furnisher, books: u32) {
    rug(add, [1.0, 0.85], books.is_multiple_of(2));
    add.at(v(0.0, 0.02, 0.0), 0.0, |add| {
        table(add, v(1.3, 0.73, 0.88), OAK);
        add.at(v(-0.3, 0.0, 0.56), 176.0, chair);
        add.at(v(0.34, 0.0, -0.58), -6.0, chair);
        add.at(v(0.0, 0.73, 0.0), 0.0, |add| {
            add.block(v(-0.52, APART, -0.15), v(0.52, 0.009, 0.15), OATMEAL);
            add.at(v(0.05, 0.01, 0.0), 0.0, fruit);
            add.at(v(-0.3, APART, 0.3), 0.0, |add| plate(add, CREAM_GLAZE));
            add.at(v(0.34, APART, -0.29), 200.0, |add| cup(add, BLUE_GLAZE));
        });
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [SingleRoom; 6] = [
        SingleRoom::Bare,
        SingleRoom::Furnished,
        SingleRoom::Crowded,
        SingleRoom::Long,
        SingleRoom::Library,
        SingleRoom::Small,
    ];

    /// If this failed, things would stick out of the walls, and the room be larger than where cameras can stand.
    #[test]
    fn everything_is_inside_the_walls() {
        for room in ALL {
            let [wide, deep] = room.measure().size;
            let model = furnished_room(room);
            for vertex in &model.vertices {
                let p = vertex.position;
                let inside = p.cmpge(DVec3::splat(-1e-9)).all() && p.cmple(v(wide, HEIGHT, deep) + 1e-9).all();
                assert!(inside, "{room:?}: {p} is outside");
            }
        }
    }

    /// If this failed, scenes that are compared as bare, furnished and crowded would be alike, one could see across the library, or they
    /// would be dark, or others each time.
    #[test]
    fn rooms_hold_what_their_names_say() {
        // Parts of the level sections at the heights of a seat and of one's head that something stands in, in cells of a tenth of a metre.
        let filled = |room: SingleRoom| {
            let [wide, deep] = room.measure().size;
            let mut cells = std::collections::BTreeSet::new();
            for vertex in &furnished_room(room).vertices {
                let p = vertex.position;
                let away = [p.x, wide - p.x, p.z, deep - p.z].into_iter().fold(f64::INFINITY, f64::min);
                if away > 0.1 && (0.1..2.0).contains(&p.y) {
                    cells.insert(((10.0 * p.x) as i32, (10.0 * p.z) as i32));
                }
            }
            cells.len() as f64 / (100.0 * wide * deep)
        };
        let shares = ALL.map(filled);
        assert!(shares[0] < 0.15 && shares[1] > 1.5 * shares[0] && shares[2] > 1.3 * shares[1], "{shares:?}");
        // Away from the walls.
        let between = |room: SingleRoom| {
            let [wide, deep] = room.measure().size;
            let away = |p: DVec3| [p.x, wide - p.x, p.z, deep - p.z].into_iter().all(|away| away > 1.1);
            let cells = |p: DVec3| ((10.0 * p.x) as i32, (10.0 * p.z) as i32);
            let model = furnished_room(room);
            let tall =
                model.vertices.iter().map(|vertex| vertex.position).filter(|p| away(*p) && (1.2..2.0).contains(&p.y));
            tall.map(cells).collect::<std::collections::BTreeSet<_>>().len()
        };
        let tall = [SingleRoom::Furnished, SingleRoom::Library].map(between);
        assert!(tall[1] > 2 * tall[0].max(50), "{tall:?}");
        for room in ALL {
            let model = furnished_room(room);
            let shining = model.faces.iter().filter(|face| model.materials[face.material as usize].shines()).count();
            assert!((4..=400).contains(&shining) && model.faces.len() < 120_000, "{room:?}: {shining} faces shine");
            assert_eq!(model, furnished_room(room));
        }
    }
}
