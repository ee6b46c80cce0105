//! What one sits and lies on: sofa, chair, pouffe, bed. Each stands on the floor around the origin and faces +Z.

use glam::{DAffine3, DVec3};

use super::furnisher::Furnisher;
use super::palette::{DARK_WOOD, LEATHER, LINEN, MUSTARD, OAK, OATMEAL, RUST, SLATE, SOFA, WALNUT};

/// Short for places.
fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A sofa for three, 2.3 m wide and 0.92 deep, with cushions and a throw.
pub(super) fn sofa(add: &mut Furnisher) {
    for (x, z) in [(-1.02, -0.36), (1.02, -0.36), (-1.02, 0.36), (1.02, 0.36)] {
        add.rod(v(x, 0.006, z), v(0.98 * x, 0.13, z), 0.025, 6, DARK_WOOD);
    }
    add.block(v(-1.13, 0.12, -0.44), v(1.13, 0.28, 0.44), SOFA);
    for side in [-1.0, 1.0] {
        let (a, b) = (side * 0.94, side * 1.15);
        add.cushion(v(a, 0.14, -0.45), v(b, 0.60, 0.46), [0.08, 0.0], 5, SOFA);
    }
    add.cushion(v(-0.945, 0.27, -0.46), v(0.945, 0.80, -0.24), [0.08, 0.0], 5, SOFA);
    for seat in 0..3 {
        let left = -0.935 + 0.625 * f64::from(seat);
        add.cushion(v(left, 0.275, -0.25), v(left + 0.62, 0.44, 0.45), [0.05, 0.025], 6, SOFA);
        add.cushion(v(left + 0.01, 0.43, -0.29), v(left + 0.61, 0.86, -0.09), [0.07, 0.03], 6, SOFA);
    }
    for (x, y, turn, size, finish) in
        [(-0.74, 0.66, 24.0, 0.23, MUSTARD), (-0.43, 0.63, 8.0, 0.20, OATMEAL), (0.72, 0.66, -28.0, 0.23, RUST)]
    {
        add.at(v(x, y, 0.06), turn, |add| {
            add.leaning(-0.35, |add| add.pillow(v(size, size, 0.085), 6, finish));
        });
    }
    // A throw over the arm on the right, a finger thick.
    let outline = |s: f64| {
        let t = 2.0 * s - 1.0;
        let (x, y) = (0.135 * t.clamp(-0.8, 0.8) / 0.8, 0.615 - 0.34 * (t.abs() - 0.72).max(0.0) / 0.28);
        v(1.045 + x, y, 0.0)
    };
    let fold = |s: f64, t: f64| outline(s) + v(0.0, 0.006 * (19.0 * t + 3.0 * s).sin(), -0.22 + 0.42 * t);
    add.patch([10, 8], OATMEAL, |s, t| fold(1.0 - s, t), |s, t| [0.9 * s, 0.42 * t]);
}

/// A chair of wood with a padded seat and a back of three slats, 0.44 m wide.
pub(super) fn chair(add: &mut Furnisher) {
    for (x, z, top) in [(-0.19, 0.18, 0.43), (0.19, 0.18, 0.43), (-0.19, -0.19, 0.9), (0.19, -0.19, 0.9)] {
        let lean = if top > 0.5 { -0.05 } else { 0.0 };
        add.rod(v(1.08 * x, 0.003, 1.1 * z), v(x, 0.43, z), 0.017, 6, WALNUT);
        if top > 0.5 {
            add.rod(v(x, 0.428, z), v(x, top, z + lean), 0.0165, 6, WALNUT);
        }
    }
    add.block(v(-0.21, 0.42, -0.21), v(0.21, 0.445, 0.21), WALNUT);
    // The pad swells in the middle.
    let (low, high) = (v(-0.2, 0.447, -0.17), v(0.2, 0.468, 0.2));
    add.box_but(low, high, SLATE, DVec3::Y);
    let pad = |s: f64, t: f64| {
        let swell = 16.0 * s * (1.0 - s) * t * (1.0 - t);
        v(low.x + (high.x - low.x) * s, high.y + 0.028 * swell.sqrt(), high.z + (low.z - high.z) * t)
    };
    add.patch([6, 6], SLATE, pad, |s, t| [0.4 * s, -0.37 * t]);
    for (y, z) in [(0.58, -0.205), (0.70, -0.219), (0.82, -0.232)] {
        add.block(v(-0.176, y, z - 0.009), v(0.176, y + 0.055, z + 0.009), WALNUT);
    }
    for side in [-0.19, 0.19] {
        add.block(v(side - 0.01, 0.2, -0.17), v(side + 0.01, 0.225, 0.16), WALNUT);
    }
}

/// A round seat of leather.
pub(super) fn pouffe(add: &mut Furnisher) {
    let outline = [
        [0.0, 0.004],
        [0.20, 0.004],
        [0.245, 0.05],
        [0.262, 0.13],
        [0.265, 0.21],
        [0.255, 0.30],
        [0.235, 0.352],
        [0.19, 0.382],
        [0.10, 0.395],
        [0.012, 0.39],
        [0.0, 0.388],
    ];
    add.turned(&outline, 18, LEATHER);
    // Piping around the upper edge.
    add.turned(&[[0.232, 0.345], [0.25, 0.348], [0.25, 0.362], [0.232, 0.365], [0.225, 0.355]], 18, DARK_WOOD);
}

/// A bed, 1.66 m wide and 2 m long, its head at -Z.
pub(super) fn bed(add: &mut Furnisher) {
    for (x, z) in [(-0.78, -0.94), (0.78, -0.94), (-0.78, 0.93), (0.78, 0.93)] {
        add.block(v(x - 0.035, 0.0, z - 0.035), v(x + 0.035, 0.2, z + 0.035), OAK);
    }
    add.block(v(-0.83, 0.2, -0.93), v(0.83, 0.32, 0.99), OAK);
    // The head: a board between two posts, in four planks.
    for plank in 0..4 {
        let y = 0.36 + 0.17 * f64::from(plank);
        add.block(v(-0.80, y, -0.985), v(0.80, y + 0.164, -0.955), OAK);
    }
    for side in [-1.0, 1.0] {
        let (a, b) = (side * 0.802, side * 0.85);
        add.block(v(a, 0.0, -0.995), v(b, 1.06, -0.94), OAK);
    }
    add.cushion(v(-0.80, 0.325, -0.925), v(0.80, 0.50, 0.965), [0.06, 0.0], 5, OATMEAL);
    for (x, finish) in [(-0.40, LINEN), (0.40, LINEN)] {
        add.at(v(x, 0.63, -0.80), 0.0, |add| add.leaning(-0.62, |add| add.pillow(v(0.34, 0.23, 0.11), 7, finish)));
    }
    add.at(v(0.03, 0.64, -0.60), 4.0, |add| add.leaning(-0.75, |add| add.pillow(v(0.25, 0.17, 0.085), 6, RUST)));
    duvet(add);
    // A blanket across the foot.
    let across = |s: f64, t: f64| {
        let x = 2.0 * s - 1.0;
        let drop = (x.abs() - 0.86).max(0.0) / 0.14;
        let wave = 0.004 * (17.0 * t + 9.0 * s).sin();
        v(0.878 * x.clamp(-0.98, 0.98), 0.618 + wave - 0.22 * drop, 0.40 + 0.42 * t + 0.03 * (4.0 * x).sin())
    };
    add.patch([24, 4], MUSTARD, |s, t| across(1.0 - s, t), |s, t| [1.9 * s, 0.45 * t]);
}

/// A duvet that lies in folds and hangs over the sides, its upper edge turned down.
fn duvet(add: &mut Furnisher) {
    let height = |x: f64, z: f64| {
        let folds = 0.012 * (5.0 * x + 7.0 * z).sin() * (3.0 * z - 4.0 * x + 1.0).sin()
            + 0.008 * (13.0 * x - 6.0 * z).sin()
            + 0.006 * (21.0 * z + 5.0 * x).sin();
        0.575 + folds
    };
    let position = |s: f64, t: f64| {
        let x = 2.0 * s - 1.0;
        let z = -0.42 + 1.425 * t.min(0.985);
        // From 0.86 of the way to either side it hangs.
        let drop = ((x.abs() - 0.84) / 0.16).max(0.0);
        let roll = (1.0 - t / 0.06).max(0.0);
        let foot = ((t - 0.94) / 0.06).max(0.0);
        let out = 0.845 * x.clamp(-0.99, 0.99) + 0.02 * drop * (11.0 * z).sin() * x.signum();
        let y = height(x, z) - 0.2 * drop * drop.min(1.0) - 0.06 * roll * roll - 0.17 * foot * foot;
        v(out, y, z)
    };
    add.patch([22, 16], LINEN, |s, t| position(1.0 - s, t), |s, t| [2.1 * s, 1.45 * t]);
    let turned_down = |s: f64, t: f64| {
        let x = 2.0 * s - 1.0;
        let z = -0.43 + 0.24 * t;
        let drop = ((x.abs() - 0.86) / 0.14).max(0.0);
        let edge = (2.0 * t - 1.0).abs().powi(6);
        v(0.85 * x.clamp(-0.99, 0.99), height(x, z) + 0.024 - 0.016 * edge - 0.2 * drop, z)
    };
    add.patch([20, 4], OATMEAL, |s, t| turned_down(1.0 - s, t), |s, t| [1.9 * s, 0.3 * t]);
}

impl Furnisher<'_> {
    /// Makes something that leans back by an angle in radians about X.
    pub(super) fn leaning(&mut self, angle: f64, make: impl FnOnce(&mut Self)) {
        self.moved(DAffine3::from_rotation_x(angle), make);
    }
}
