//! Two furnished rooms: their walls, and where everything stands.

use glam::{DAffine3, DVec3};

use super::cabinets::{architrave, chest, door, shelf, stack_of_books, table, wardrobe};
use super::fittings::{ceiling_lamp, curtains, pendant, picture, radiator, rug, standing_lamp, window};
use super::furnisher::{APART, Finish, Furnisher, Gloss};
use super::palette::{BLUE_GLAZE, BRASS, CLAY, CREAM_GLAZE, DARK_WOOD, GRAPHITE, OAK, OATMEAL, SAGE, WALNUT, WHITE};
use super::seats::{bed, chair, pouffe, sofa};
use super::texture::Texture;
use super::things::{bowl, cup, desk_lamp, fruit, keyboard, monitor, pens, plant, plate, twigs, vase};
use crate::scene::model::Model;

/// Heights of the ceiling and of the doorway, depth of the rooms, where the wall between them is, and how far the smaller one goes.
const HEIGHT: f64 = 2.6;
const DOOR: f64 = 2.05;
const DEPTH: f64 = 5.0;
const WALL: [f64; 2] = [6.0, 6.1];
const END: f64 = 10.0;
/// The doorway along z.
const WAY: [f64; 2] = [2.1, 3.0];

const FLOOR: Finish = Finish::of(Texture::Planks).with(Gloss::Varnished);
const CEILING: Finish = Finish::of(Texture::Plaster).tinted(250, 248, 244);
const PLASTER: Finish = Finish::of(Texture::Plaster).tinted(240, 233, 220);
const GREEN: Finish = Finish::of(Texture::Plaster).tinted(176, 188, 172);
const BLUE: Finish = Finish::of(Texture::Plaster).tinted(206, 212, 212);
const PAPERED: Finish = Finish::of(Texture::Wallpaper);

/// Short for places.
fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Two furnished rooms with a door between them, a living room and a bedroom with a desk, lit by windows and lamps; +Y up, in metres,
/// the floor at 0. The larger one goes from (0, 0, 0) to (6, 2.6, 5), the smaller one from x = 6.1 to 10.
pub fn two_rooms_model() -> Model {
    let mut model = Model::default();
    let mut add = Furnisher::new(&mut model, DAffine3::IDENTITY);
    shell(&mut add);
    trim(&mut add);
    living_room(&mut add);
    bedroom(&mut add);
    model
}

/// A wall with an opening, from a corner along one side and up: the opening goes from `from` to `to` along and up.
pub(super) fn wall(add: &mut Furnisher, corner: DVec3, along: DVec3, from: [f64; 2], to: [f64; 2], finish: Finish) {
    let (direction, length) = (along.normalize(), along.length());
    let mut piece = |a: [f64; 2], b: [f64; 2]| {
        if b[0] > a[0] && b[1] > a[1] {
            let sides = [(b[0] - a[0]) * direction, v(0.0, b[1] - a[1], 0.0)];
            add.sheet(corner + a[0] * direction + v(0.0, a[1], 0.0), sides, finish);
        }
    };
    piece([0.0, 0.0], [from[0], HEIGHT]);
    piece([to[0], 0.0], [length, HEIGHT]);
    piece([from[0], 0.0], [to[0], from[1]]);
    piece([from[0], to[1]], [to[0], HEIGHT]);
}

/// Middle of a window on a wall z = 0 or x = 10, its height, and half its size.
const LIVING_WINDOW: ([f64; 2], [f64; 2]) = ([2.9, 1.52], [1.0, 0.66]);
const DESK_WINDOW: ([f64; 2], [f64; 2]) = ([7.45, 1.58], [0.62, 0.56]);

fn shell(add: &mut Furnisher) {
    let (up, deep) = (v(0.0, HEIGHT, 0.0), v(0.0, 0.0, DEPTH));
    for (low, high) in [(0.0, WALL[0]), (WALL[1], END)] {
        let wide = v(high - low, 0.0, 0.0);
        add.sheet(v(low, 0.0, DEPTH), [wide, -deep], FLOOR);
        add.sheet(v(low, HEIGHT, 0.0), [wide, deep], CEILING);
    }
    for (low, high, ([x, y], [a, b]), finish) in
        [(0.0, WALL[0], LIVING_WINDOW, PLASTER), (WALL[1], END, DESK_WINDOW, BLUE)]
    {
        wall(add, v(low, 0.0, 0.0), v(high - low, 0.0, 0.0), [x - low - a, y - b], [x - low + a, y + b], finish);
        add.sheet(v(high, 0.0, DEPTH), [v(low - high, 0.0, 0.0), up], finish);
    }
    add.sheet(v(0.0, 0.0, DEPTH), [-deep, up], GREEN);
    add.sheet(v(END, 0.0, 0.0), [deep, up], PAPERED);
    // The wall between the rooms, and the reveal of its doorway.
    wall(add, v(WALL[0], 0.0, 0.0), deep, [WAY[0], 0.0], [WAY[1], DOOR], PLASTER);
    wall(add, v(WALL[1], 0.0, DEPTH), -deep, [DEPTH - WAY[1], 0.0], [DEPTH - WAY[0], DOOR], BLUE);
    let (thick, wide, high) = (v(WALL[1] - WALL[0], 0.0, 0.0), v(0.0, 0.0, WAY[1] - WAY[0]), v(0.0, DOOR, 0.0));
    add.sheet(v(WALL[0], 0.0, WAY[0]), [thick, high], WHITE);
    add.sheet(v(WALL[1], 0.0, WAY[1]), [-thick, high], WHITE);
    add.sheet(v(WALL[0], DOOR, WAY[0]), [thick, wide], WHITE);
    add.sheet(v(WALL[0], 0.0, WAY[0]), [wide, thick], OAK);
}

/// Skirting boards, mouldings below the ceiling, boards around doors.
fn trim(add: &mut Furnisher) {
    // Along a wall: where it begins, the angle that it faces, the pieces along it to the right as one looks at it.
    let doorway = [WAY[0] - 0.075, WAY[1] + 0.075];
    let runs: [(DVec3, f64, &[[f64; 2]]); 8] = [
        (v(0.0, 0.0, 0.0), 0.0, &[[0.0, WALL[0]]]),
        (v(WALL[0], 0.0, DEPTH), 180.0, &[[0.0, 3.41], [4.39, WALL[0]]]),
        (v(0.0, 0.0, DEPTH), 90.0, &[[0.02, DEPTH - 0.02]]),
        (v(WALL[0], 0.0, 0.0), 270.0, &[[0.02, doorway[0]], [doorway[1], DEPTH - 0.02]]),
        (v(WALL[1], 0.0, 0.0), 0.0, &[[0.0, END - WALL[1]]]),
        (v(END, 0.0, DEPTH), 180.0, &[[0.0, END - WALL[1]]]),
        (v(WALL[1], 0.0, DEPTH), 90.0, &[[0.02, DEPTH - doorway[1]], [DEPTH - doorway[0], DEPTH - 0.02]]),
        (v(END, 0.0, 0.0), 270.0, &[[0.02, DEPTH - 0.02]]),
    ];
    for (corner, degrees, pieces) in runs {
        add.at(corner, degrees, |add| {
            let end = pieces[pieces.len() - 1][1];
            for [from, to] in pieces {
                add.box_but(v(*from, 0.0, 0.0), v(*to, 0.075, 0.016), WHITE, DVec3::NEG_Z);
                add.box_but(v(*from, 0.075, 0.0), v(*to, 0.09, 0.01), WHITE, DVec3::NEG_Z);
            }
            let from = pieces[0][0];
            add.box_but(v(from, HEIGHT - 0.06, 0.0), v(end, HEIGHT - APART, 0.018), WHITE, DVec3::NEG_Z);
            let inset = if from > 0.0 { from + 0.025 } else { 0.0 };
            let until = if from > 0.0 { end - 0.025 } else { end };
            add.block(v(inset, HEIGHT - 0.03, 0.019), v(until, HEIGHT - APART, 0.045), WHITE);
        });
    }
    let middle = 0.5 * (WAY[0] + WAY[1]);
    add.at(v(WALL[0], 0.0, middle), 270.0, |add| architrave(add, 0.45, DOOR));
    add.at(v(WALL[1], 0.0, middle), 90.0, |add| architrave(add, 0.45, DOOR));
}

fn living_room(add: &mut Furnisher) {
    let ([x, y], half) = LIVING_WINDOW;
    add.at(v(x, y, 0.0), 0.0, |add| window(add, half, [0.02, 0.55]));
    add.at(v(x, 0.0, 0.0), 0.0, |add| {
        curtains(add, [0.98, 1.42], [0.04, 2.36]);
        radiator(add, 0.62, 0.66);
    });
    // A sofa against the green wall with three pictures above it, a lamp and a small table at its ends.
    add.at(v(0.53, 0.0, 2.4), 90.0, sofa);
    for (z, y, size, mat, number, finish) in [
        (3.25, 1.62, [0.28, 0.36], 0.05, 2, OAK),
        (2.4, 1.62, [0.46, 0.36], 0.0, 0, DARK_WOOD),
        (1.55, 1.62, [0.28, 0.36], 0.05, 5, OAK),
    ] {
        add.at(v(0.0, y, z), 90.0, |add| picture(add, size, mat, number, finish));
    }
    add.at(v(0.42, 0.0, 4.2), 0.0, |add| standing_lamp(add, 1.5, 0.19, GRAPHITE));
    add.at(v(0.5, 0.0, 0.82), 0.0, |add| {
        let outline = [[0.0, 0.48], [0.22, 0.48], [0.225, 0.485], [0.225, 0.5], [0.0, 0.502]];
        add.turned(&outline, 24, WALNUT);
        for turn in [0.0, 120.0, 240.0] {
            add.at(DVec3::ZERO, turn, |add| add.rod(v(0.0, 0.006, 0.2), v(0.0, 0.479, 0.1), 0.013, 6, DARK_WOOD));
        }
        add.at(v(-0.03, 0.504, -0.05), 30.0, |add| stack_of_books(add, [0.2, 0.15], &[0.03, 0.024], 12));
        add.at(v(0.1, 0.504, 0.09), 150.0, |add| cup(add, BLUE_GLAZE));
    });
    dining(add);
    for x in [1.1, 4.7] {
        add.at(v(x, HEIGHT, 2.5), 0.0, |add| ceiling_lamp(add, 0.42));
    }
    // Books, with a door beside them.
    add.at(v(4.5, 0.0, DEPTH - 0.21), 180.0, |add| {
        shelf(add, |add, free| match free {
            0 => vase(add, 0.22, CLAY),
            1 => stack_of_books(add, [0.2, 0.15], &[0.035, 0.028, 0.024], 40),
            2 => bowl(add, 0.1, BLUE_GLAZE),
            3 => vase(add, 0.26, CREAM_GLAZE),
            _ => add.block(v(-0.09, 0.0, -0.1), v(0.09, 0.16, 0.06), SAGE),
        });
        add.at(v(-0.55, 1.91, 0.0), 0.0, |add| stack_of_books(add, [0.24, 0.18], &[0.04, 0.03, 0.026], 50));
        add.at(v(0.45, 1.91, 0.0), 20.0, |add| vase(add, 0.3, BLUE_GLAZE));
    });
    add.at(v(2.1, 0.0, DEPTH), 180.0, door);
    add.at(v(5.38, 0.0, 0.66), 0.0, plant);
    add.at(v(4.62, 0.0, 1.12), 0.0, pouffe);
    add.at(v(WALL[0], 1.55, 1.25), 270.0, |add| picture(add, [0.4, 0.4], 0.0, 1, OAK));
    add.at(v(WALL[0], 1.55, 4.0), 270.0, |add| picture(add, [0.38, 0.5], 0.07, 3, GRAPHITE));
    add.at(v(1.05, 1.6, DEPTH), 180.0, |add| picture(add, [0.3, 0.3], 0.05, 7, DARK_WOOD));
}

/// A table with chairs around it on a rug, below a lamp.
fn dining(add: &mut Furnisher) {
    let middle = v(2.9, 0.0, 2.35);
    add.at(middle, 0.0, |add| rug(add, [1.25, 0.94], false));
    let above = middle + v(0.0, 0.014, 0.0);
    add.at(above, 0.0, |add| table(add, v(1.3, 0.73, 0.88), OAK));
    for (x, z, degrees) in [(-0.3, 0.56, 176.0), (0.34, 0.6, 190.0), (-0.28, -0.58, -6.0), (0.86, 0.02, 265.0)] {
        add.at(above + v(x, 0.0, z), degrees, chair);
    }
    add.at(above + v(0.0, 0.73, 0.0), 0.0, |add| {
        // A runner of cloth.
        add.block(v(-0.52, APART, -0.15), v(0.52, 0.009, 0.15), OATMEAL);
        add.at(v(0.02, 0.01, 0.0), 0.0, fruit);
        add.at(v(-0.32, 0.01, 0.02), 0.0, |add| {
            vase(add, 0.24, BLUE_GLAZE);
            add.at(v(0.0, 0.16, 0.0), 0.0, |add| twigs(add, 0.34, 4));
        });
        for (x, z, turn) in [(-0.3, 0.29, 30.0), (0.34, 0.29, 200.0)] {
            add.at(v(x, 0.0, z), 0.0, |add| plate(add, CREAM_GLAZE));
            add.at(v(x + 0.22, 0.0, z - 0.04), turn, |add| cup(add, CREAM_GLAZE));
        }
        add.at(v(0.38, APART, -0.27), 24.0, |add| stack_of_books(add, [0.25, 0.19], &[0.034, 0.028], 20));
    });
    add.at(middle + v(0.0, HEIGHT - APART, 0.0), 0.0, |add| pendant(add, 0.72));
}

fn bedroom(add: &mut Furnisher) {
    add.at(v(9.05, 0.0, 3.97), 180.0, bed);
    add.at(v(8.3, 0.0, 3.05), 90.0, |add| rug(add, [0.72, 0.98], true));
    add.at(v(7.93, 0.0, 4.72), 180.0, |add| {
        chest(add, v(0.44, 0.5, 0.4), 2, WALNUT);
        add.at(v(0.06, 0.5, 0.0), 0.0, |add| standing_lamp(add, 0.36, 0.11, CLAY));
        add.at(v(-0.13, 0.502, 0.1), 80.0, |add| stack_of_books(add, [0.16, 0.11], &[0.026, 0.02], 30));
    });
    for (x, number) in [(9.42, 4), (8.68, 6)] {
        add.at(v(x, 1.66, DEPTH), 180.0, |add| picture(add, [0.31, 0.31], 0.04, number, OAK));
    }
    add.at(v(9.67, 0.0, 0.86), 270.0, |add| wardrobe(add, SAGE));
    add.at(v(END, 1.5, 2.2), 270.0, |add| picture(add, [0.3, 0.4], 0.05, 8, BRASS));
    desk(add);
    // A chest of drawers against the wall to the living room.
    add.at(v(WALL[1] + 0.24, 0.0, 4.1), 90.0, |add| {
        chest(add, v(1.1, 0.84, 0.42), 3, WHITE);
        add.at(v(-0.3, 0.842, 0.0), 0.0, |add| {
            vase(add, 0.26, CREAM_GLAZE);
            add.at(v(0.0, 0.17, 0.0), 40.0, |add| twigs(add, 0.38, 4));
        });
        add.at(v(0.28, 0.842, 0.02), 0.0, |add| bowl(add, 0.12, CLAY));
        add.at(v(0.02, 0.842, 0.04), 60.0, |add| stack_of_books(add, [0.22, 0.16], &[0.03, 0.036, 0.022], 60));
    });
    add.at(v(WALL[1], 1.5, 4.1), 90.0, |add| picture(add, [0.42, 0.33], 0.05, 4, DARK_WOOD));
    add.at(v(8.0, HEIGHT, 2.5), 0.0, |add| ceiling_lamp(add, 0.42));
}

/// A desk below the window, with a chair.
fn desk(add: &mut Furnisher) {
    let ([x, y], half) = DESK_WINDOW;
    add.at(v(x, y, 0.0), 0.0, |add| window(add, half, [0.55, 0.93]));
    add.at(v(x, 0.0, 0.0), 0.0, |add| curtains(add, [0.62, 0.92], [0.86, 2.36]));
    add.at(v(7.4, 0.0, 0.56), 0.0, |add| {
        table(add, v(1.6, 0.75, 0.7), WALNUT);
        add.at(v(0.02, 0.75, -0.12), 0.0, monitor);
        add.at(v(0.02, 0.75, 0.16), 0.0, keyboard);
        add.at(v(-0.6, 0.75, -0.1), 10.0, desk_lamp);
        add.at(v(-0.42, 0.75, 0.1), 0.0, pens);
        add.at(v(0.58, 0.752, -0.1), 84.0, |add| {
            stack_of_books(add, [0.24, 0.18], &[0.036, 0.028, 0.03, 0.02], 4);
        });
        add.at(v(0.46, 0.75, 0.18), 40.0, |add| cup(add, BLUE_GLAZE));
    });
    add.at(v(7.5, 0.0, 1.3), 168.0, chair);
}
