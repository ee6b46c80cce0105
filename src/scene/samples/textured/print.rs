//! Print: rows of words in signs that look like letters, spines of books, and pages.

use glam::Vec3;

use super::noise::{Noise, band, rgb, split, step};

/// Columns and rows of a sign, and of the cell that it stands in.
const SIGN: [i32; 2] = [4, 7];
const CELL: [f32; 2] = [5.5, 11.0];

/// Spines in a row of their texture, and its rows.
pub(super) const SPINES: [u32; 2] = [32, 2];

/// Colours of bindings.
const BINDINGS: [Vec3; 14] = [
    rgb(142, 62, 52),
    rgb(58, 86, 112),
    rgb(196, 166, 108),
    rgb(92, 112, 84),
    rgb(214, 204, 184),
    rgb(112, 74, 56),
    rgb(74, 78, 86),
    rgb(188, 118, 76),
    rgb(128, 148, 156),
    rgb(224, 214, 198),
    rgb(108, 66, 84),
    rgb(170, 158, 136),
    rgb(66, 104, 102),
    rgb(206, 186, 142),
];

/// Signs of a typeface of its own.
pub(super) struct Print {
    noise: Noise,
}

impl Print {
    /// A typeface by the stream of its random numbers.
    pub fn new(stream: u32) -> Self {
        Self { noise: Noise::new(stream) }
    }

    /// Whether a cell of a sign has ink. Signs are made of strokes as letters are: two at the sides, each of two halves, and three
    /// across.
    fn stroke(&self, sign: u32, column: i32, row: i32) -> f32 {
        if !(0..SIGN[0]).contains(&column) || !(0..SIGN[1]).contains(&row) {
            return 0.0;
        }
        let [a, b, c, d] = self.noise.random(1000 + sign);
        // A space between words.
        if d < 0.16 {
            return 0.0;
        }
        let (last, middle, bottom) = (SIGN[0] - 1, SIGN[1] / 2, SIGN[1] - 1);
        let upper = row <= middle;
        let inked = match (column, row) {
            (0, _) => a < 0.8 || upper,
            (right, _) if right == last => (if upper { b } else { 1.0 - b }) < 0.62,
            (_, 0) => c < 0.6,
            (_, at) if at == middle => (c * 7.0).fract() < 0.6,
            (_, at) if at == bottom => (c * 13.0).fract() < 0.55,
            _ => false,
        };
        f32::from(u8::from(inked))
    }

    /// Ink in [0, 1] at a place of a block of print, (0, 0) to (1, 1) from the top left, with so many signs in so many lines.
    /// `first` makes blocks differ. It is smooth between cells of signs.
    pub fn page(&self, [x, y]: [f32; 2], [signs, lines]: [f32; 2], first: u32) -> f32 {
        if !(0.0..1.0).contains(&x) || !(0.0..1.0).contains(&y) {
            return 0.0;
        }
        let (sign, a) = split(x * signs);
        let (line, b) = split(y * lines);
        // Lines end where it pleases.
        let ends = 0.55 + 0.45 * self.noise.random(500 + first + line as u32)[0];
        if lines > 1.5 && x > ends {
            return 0.0;
        }
        let ((column, s), (row, t)) = (split(a * CELL[0] - 0.5), split(b * CELL[1] - 1.5));
        let number = (first * 97 + line as u32 * 61 + sign as u32) % 4000;
        let at = |i: i32, j: i32| self.stroke(number, column + i, row + j);
        let top = at(0, 0) + s * (at(1, 0) - at(0, 0));
        let bottom = at(0, 1) + s * (at(1, 1) - at(0, 1));
        top + t * (bottom - top)
    }
}

/// Spines of books side by side: bands and titles along them, worn at their edges.
pub(super) fn spines() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(9);
    let print = Print::new(10);
    let draws: Vec<[[f32; 4]; 2]> =
        (0..SPINES[0] * SPINES[1]).map(|book| [noise.random(book), noise.random(100 + book)]).collect();
    move |x, y| {
        let (column, u) = split(SPINES[0] as f32 * x);
        let (row, v) = split(SPINES[1] as f32 * y);
        let number = column as u32 % SPINES[0] + SPINES[0] * (row as u32 % SPINES[1]);
        let [a, b] = draws[number as usize];
        let colour = BINDINGS[(a[0] * BINDINGS.len() as f32) as usize];
        let cloth = noise.sum([x, y], [256, 128], 2);
        let wear = noise.sum([x, y], [64, 16], 3);
        let binding = colour * (1.0 + 0.07 * cloth + 0.09 * wear);
        let dark = colour.element_sum() < 1.35;
        let ink = match (dark, b[0] < 0.6) {
            (true, true) => rgb(214, 186, 122),
            (true, false) => rgb(226, 222, 210),
            (false, true) => rgb(74, 50, 44),
            (false, false) => rgb(48, 64, 88),
        };
        // Bands near the ends, sometimes a field under the title.
        let mut inked = 0.0f32;
        let ends = v.min(1.0 - v);
        if a[1] < 0.7 {
            inked = inked.max(band(0.045, 0.06, 0.008, ends)).max(band(0.075, 0.082, 0.006, ends));
        }
        if a[1] < 0.25 {
            inked = inked.max(band(0.15, 0.165, 0.008, v));
        }
        let field = if a[2] < 0.35 { band(0.22, 0.66, 0.01, v) * band(0.06, 0.94, 0.06, u) } else { 0.0 };
        let other = BINDINGS[((a[2] * 31.0).fract() * BINDINGS.len() as f32) as usize];
        let ground = binding.lerp(other * (1.0 + 0.06 * cloth), 0.9 * field);
        let ink = if field > 0.5 && other.element_sum() >= 1.35 { rgb(60, 48, 44) } else { ink };
        // The title runs down the spine; the author's name is at its foot.
        let signs = 7.0 + (5.0 * b[1]).floor();
        inked = inked.max(print.page([(v - 0.25) / 0.38, 0.94 - 0.88 * u], [signs, 1.0], 3 * number + 1));
        let small = print.page([(v - 0.7) / 0.14, (0.78 - u) / 0.56], [5.0, 1.0], 3 * number + 2);
        inked = inked.max(small);
        let edge = u.min(1.0 - u);
        let round = 0.72 + 0.28 * step(0.0, 0.22, edge) + 0.06 * band(0.3, 0.5, 0.2, u);
        let scuffed = 0.35 * step(0.06, 0.0, ends.min(0.5 * edge) + 0.02 * wear);
        (ground.lerp(ink, 0.88 * inked.min(1.0)) * round).lerp(rgb(206, 192, 168), scuffed * 0.5)
    }
}

/// The cut side of a book's pages along x, and paper: fine lines, yellowed.
pub(super) fn paper() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(11);
    move |x, y| {
        let leaves = noise.sum([x, y], [3, 128], 2);
        let age = noise.sum([x, y], [4, 6], 3);
        rgb(218, 208, 186) * (1.0 + 0.1 * leaves + 0.05 * age)
    }
}

/// What a screen shows: a document between bars, with a picture in it.
pub(super) fn screen() -> impl Fn(f32, f32) -> Vec3 + Sync {
    let noise = Noise::new(12);
    let print = Print::new(13);
    move |x, y| {
        let grid = 1.0 + 0.05 * noise.sum([x, y], [64, 64], 2);
        if y < 0.07 {
            let ink = print.page([(x - 0.02) / 0.4, y / 0.07], [18.0, 1.0], 90);
            return rgb(70, 84, 100).lerp(rgb(200, 206, 210), 0.8 * ink) * grid;
        }
        if x < 0.2 {
            let ink = print.page([(x - 0.02) / 0.16, (y - 0.1) / 0.85], [9.0, 14.0], 120);
            let marked = band(0.28, 0.345, 0.006, y);
            let ground = rgb(116, 128, 138).lerp(rgb(92, 130, 150), marked);
            return ground.lerp(rgb(214, 218, 220), 0.7 * ink) * grid;
        }
        let page = rgb(206, 208, 204);
        let inside = band(0.6, 0.94, 0.004, x) * band(0.14, 0.5, 0.006, y);
        if inside > 0.5 {
            let hill = 0.32 + 0.06 * noise.sum([x, 0.2], [6, 1], 4);
            let near = 0.40 + 0.05 * noise.sum([x, 0.7], [9, 1], 4);
            let sky = rgb(150, 180, 200).lerp(rgb(216, 200, 170), step(0.14, 0.34, y));
            let land = rgb(104, 124, 112).lerp(rgb(70, 92, 66), step(near - 0.005, near + 0.005, y));
            return sky.lerp(land, step(hill - 0.005, hill + 0.005, y)) * grid;
        }
        let right = if y < 0.54 { 0.33 } else { 0.7 };
        let ink = print.page([(x - 0.24) / right, (y - 0.12) / 0.84], [right * 52.0, 20.0], 200);
        page.lerp(rgb(58, 60, 66), 0.85 * ink) * grid
    }
}
