//! One point's clients: the directions in which the pool can show it, and the two nearest chosen photos of each.

use std::f32::consts::PI;

use glam::Vec3;

use super::objective::WANTED;

/// Directions that are looked at together.
const LANES: usize = 16;
/// Blocks whose clients are moved together, and these clients: a byte numbers them.
const WINDOW: usize = 8;
const CLIENTS: usize = WINDOW * LANES;
/// Cosine of no photo at all, and of a lane that only fills up a block: below and above every cosine.
const NONE: f32 = -2.0;
const OUT: f32 = 2.0;
/// Slot of no photo.
const NO_SLOT: u32 = u32::MAX;

type Lanes = [f32; LANES];

/// The directions that count at a point, a component each. Those that no photo of the pool is near to are left out: all
/// passes are shorter by that, most of a sphere.
#[derive(Clone, Default)]
pub(super) struct Directions {
    blocks: Vec<[Lanes; 3]>,
    /// How many; the last block is filled up with zeros.
    pub(super) count: usize,
}

/// What the chosen photos give one point.
#[derive(Clone)]
pub(super) struct Nearest {
    blocks: Vec<Block>,
    /// Chosen photos that see the point, and the slots of the first few.
    pub(super) views: u32,
    pub(super) seers: [u32; WANTED as usize],
}

/// The two nearest photos of some clients, by cosine and by angle, and the slot of the nearest.
#[derive(Clone)]
struct Block {
    cos: [Lanes; 2],
    angle: [Lanes; 2],
    slot: [u32; LANES],
}

/// Angle of a cosine, within 3e-8 of a half turn: Abramowitz and Stegun 4.4.46. Adds and multiplies only, but for one root,
/// so that it is the same on every host and fast in bulk.
fn angle(cos: f32) -> f32 {
    const FACTORS: [f32; 8] = [
        std::f32::consts::FRAC_PI_2,
        -0.214_598_8,
        0.088_978_99,
        -0.050_174_305,
        0.030_891_88,
        -0.017_088_126,
        0.006_670_09,
        -0.001_262_491_1,
    ];
    let x = cos.abs().min(1.0);
    let series = FACTORS.iter().rev().fold(0.0, |sum, factor| sum * x + factor);
    let acute = (1.0 - x).sqrt() * series;
    if cos < 0.0 { PI - acute } else { acute }
}

#[inline(always)]
fn dot([x, y, z]: &[Lanes; 3], n: Vec3) -> Lanes {
    std::array::from_fn(|lane| x[lane] * n.x + y[lane] * n.y + z[lane] * n.z)
}

impl Directions {
    pub(super) fn new(directions: &[Vec3]) -> Self {
        let block = |some: &[Vec3]| {
            [0, 1, 2].map(|axis| std::array::from_fn(|lane| some.get(lane).map_or(0.0, |direction| direction[axis])))
        };
        Self { blocks: directions.chunks(LANES).map(block).collect(), count: directions.len() }
    }

    /// Bytes of the directions and of one choice's two nearest.
    pub(super) fn bytes(&self) -> usize {
        self.blocks.len() * (size_of::<[Lanes; 3]>() + size_of::<Block>())
    }
}

impl Nearest {
    /// No photo chosen.
    pub(super) fn new(directions: &Directions) -> Self {
        let block = |first: usize| {
            let cos = std::array::from_fn(|lane| if first + lane < directions.count { NONE } else { OUT });
            Block { cos: [cos; 2], angle: [[0.0; LANES]; 2], slot: [NO_SLOT; LANES] }
        };
        let blocks = (0..directions.count).step_by(LANES).map(block).collect();
        Self { blocks, views: 0, seers: [NO_SLOT; WANTED as usize] }
    }

    /// Adds a photo in unit direction `n`.
    pub(super) fn insert(&mut self, directions: &Directions, n: Vec3, slot: u32) {
        for (block, directions) in self.blocks.iter_mut().zip(&directions.blocks) {
            for (lane, cos) in dot(directions, n).into_iter().enumerate() {
                block.offer(lane, cos, slot);
            }
        }
    }

    /// Takes a photo in unit direction `n` out. Only the clients that it was one of the two nearest to are searched again,
    /// among the `others`: slots and unit directions.
    pub(super) fn remove(&mut self, directions: &Directions, n: Vec3, others: &[(u32, Vec3)]) {
        for (block, directions) in self.blocks.iter_mut().zip(&directions.blocks) {
            // The same cosine as when it was put in, to the bit.
            for (lane, cos) in dot(directions, n).into_iter().enumerate() {
                if cos < block.cos[1][lane] {
                    continue;
                }
                block.cos.iter_mut().for_each(|all| all[lane] = NONE);
                block.slot[lane] = NO_SLOT;
                let [x, y, z] = directions.map(|axis| axis[lane]);
                for (slot, n) in others {
                    block.offer(lane, x * n.x + y * n.y + z * n.z, *slot);
                }
            }
        }
    }

    /// Takes note of the slots of all chosen photos that see the point, and brings the angles up to date.
    pub(super) fn settle(&mut self, seers: impl Iterator<Item = u32>) {
        (self.views, self.seers) = (0, [NO_SLOT; WANTED as usize]);
        for slot in seers {
            if let Some(seer) = self.seers.get_mut(self.views as usize) {
                *seer = slot;
            }
            self.views += 1;
        }
        for block in &mut self.blocks {
            for (cos, out) in block.cos.iter().zip(&mut block.angle) {
                for (cos, out) in cos.iter().zip(out) {
                    let known = angle(*cos);
                    *out = if *cos == OUT {
                        0.0
                    } else if *cos == NONE {
                        PI
                    } else {
                        known
                    };
                }
            }
        }
    }

    /// Sum of the angles to the nearest photo.
    pub(super) fn sum(&self) -> f64 {
        self.blocks.iter().flat_map(|block| block.angle[0]).map(f64::from).sum()
    }

    /// Slot of the nearest photo of each client that has one, and by how much the next is farther.
    pub(super) fn losses(&self) -> impl Iterator<Item = (usize, f32)> + '_ {
        self.blocks.iter().flat_map(|block| {
            let [first, second] = &block.angle;
            let lanes = (0..LANES).filter(|lane| block.slot[*lane] != NO_SLOT);
            lanes.map(|lane| (block.slot[lane] as usize, second[lane] - first[lane]))
        })
    }

    /// What a photo in unit direction `n` would do for the clients, whose angles have this weight: adds to `gain` how much
    /// nearer it is than the nearest, and to `spared`, by slot, how much it would make up for the loss of the nearest.
    pub(super) fn gain(&self, directions: &Directions, n: Vec3, weight: f64, mut gain: f64, spared: &mut [f64]) -> f64 {
        for (blocks, directions) in self.blocks.chunks(WINDOW).zip(directions.blocks.chunks(WINDOW)) {
            // Few clients have it nearer than their second. They are moved together without a branch, since no guess at
            // who is among them would be good, and their angles taken in bulk.
            let (mut own, mut clients, mut few) = ([0f32; CLIENTS], [0u8; CLIENTS], 0);
            for ((block, directions), first) in blocks.iter().zip(directions).zip((0u8..).step_by(LANES)) {
                let cos = dot(directions, n);
                let second = &block.cos[1];
                if !(0..LANES).fold(false, |any, lane| any | (cos[lane] > second[lane])) {
                    continue;
                }
                for (lane, client) in (0..LANES).zip(first..) {
                    (own[few % CLIENTS], clients[few % CLIENTS]) = (cos[lane], client);
                    few += usize::from(cos[lane] > second[lane]);
                }
            }
            for four in own[..few.next_multiple_of(4)].as_chunks_mut::<4>().0 {
                *four = four.map(angle);
            }
            for (own, client) in own[..few].iter().zip(clients) {
                let (block, lane) = (&blocks[usize::from(client) / LANES], usize::from(client) % LANES);
                let [first, second] = [block.angle[0][lane], block.angle[1][lane]];
                gain += weight * f64::from((first - own).max(0.0));
                if block.slot[lane] != NO_SLOT {
                    spared[block.slot[lane] as usize] += weight * f64::from((second - own.max(first)).max(0.0));
                }
            }
        }
        gain
    }
}

impl Block {
    /// Without branches, so that it goes through many lanes at once.
    fn offer(&mut self, lane: usize, cos: f32, slot: u32) {
        let [first, second] = &mut self.cos;
        let nearer = cos > first[lane];
        second[lane] = if nearer { first[lane] } else { second[lane].max(cos) };
        self.slot[lane] = if nearer { slot } else { self.slot[lane] };
        first[lane] = if nearer { cos } else { first[lane] };
    }
}
