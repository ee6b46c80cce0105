//! What is minimised over subsets of a pool: the angular gap on the real frusta, as it is to be expected of photos that
//! may fail.
//!
//! For a point `p` and a direction `w` in which the pool can show it, the gap is the angle from `w` to the nearest chosen
//! photo that sees `p`, and pi where none does: a facility location (k-median) problem, whose facilities are photos and
//! whose clients are pairs of point and direction. Whether a photo sees a point is known at a sample of a coarse surface
//! only. The cost therefore takes every photo to fail a point with probability [`FAILURE`], independently, and counts the
//! expected angle over the three nearest (Snyder and Daskin, "Reliability models for facility location", 2005):
//! `(1 - q) d1 + (1 - q) q d2 + q² d3`, where what is missing is pi. A point's cost is the mean over its directions, the
//! whole the mean over points, weighted by their scores. With `q = 0` it is the held-out metric itself, and worse at
//! lowering that metric: swaps learn the sample's occlusion by heart (docs/selection.md).

use std::f32::consts::PI;

use glam::Vec3;

use super::parallel::{in_parallel, with_scratch};
use super::sight::Survey;
use crate::scene::octahedral;

/// A direction counts at a point where some photo of the pool that sees the point lies within this angle of it.
pub const REACH_DEG: f64 = 15.0;
/// Nearest photos that count, and one more, which steps in for one that is removed.
const COUNTED: usize = 3;
const KEPT: usize = COUNTED + 1;
/// Probability that a photo fails a point that it is thought to see.
pub const FAILURE: f32 = 0.2;

/// Directions that are looked at together.
const LANES: usize = 16;
/// Cosine of no photo at all, and of a direction that does not count: below and above every cosine.
const NONE: f32 = -2.0;
const OUT: f32 = 2.0;
/// Slot of no photo.
const NO_SLOT: u32 = u32::MAX;

/// The clients: points and directions, with their weights.
pub struct Objective<'s> {
    pub(super) survey: &'s Survey,
    /// Points that each photo sees.
    pub(super) seen: Vec<Vec<u32>>,
    /// Directions of the texels, a component each.
    axes: [Vec<f32>; 3],
    /// Per point and texel: whether the direction counts.
    reach: Vec<bool>,
    /// Per point: weight of one texel's angle.
    texel_weight: Vec<f64>,
    /// Per photo: what choosing it costs by itself (its want of sharpness).
    price: Vec<f64>,
}

/// The two nearest chosen photos of every client, and what follows from them.
pub struct Choice<'o, 's> {
    objective: &'o Objective<'s>,
    /// The photo in each slot.
    chosen: Vec<usize>,
    points: Vec<Nearest>,
    /// Per slot: rise of the cost if its photo were removed.
    losses: Vec<f64>,
}

/// One point's clients: for every texel the four nearest chosen photos that see the point, nearest first.
#[derive(Clone)]
struct Nearest {
    /// Cosine of the last of them: what a photo must surpass to matter.
    bar: Vec<f32>,
    angle: Vec<[f32; KEPT]>,
    slot: Vec<[u32; KEPT]>,
    cost: f64,
}

/// Expected angle to the nearest photo that does not fail, from the angles in ascending order.
fn expected(angles: [f32; COUNTED]) -> f32 {
    let q = FAILURE;
    (1.0 - q) * (angles[0] + q * angles[1]) + q * q * angles[2]
}

/// The list without its entry `k`.
fn without(angles: &[f32; KEPT], k: usize) -> [f32; COUNTED] {
    std::array::from_fn(|i| angles[if i < k { i } else { i + 1 }])
}

/// The least three of an ascending list and one more.
fn with(angles: [f32; COUNTED], more: f32) -> [f32; COUNTED] {
    let [a, b, c] = angles;
    [a.min(more), b.min(a.max(more)), c.min(b.max(more))]
}

/// A swap: how the cost changes, and which slot gets the new photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swap {
    /// Change of the cost; negative is better.
    pub change: f64,
    /// The slot whose photo goes.
    pub slot: usize,
}

/// Angle of a cosine, within 3e-8 of a half turn: Abramowitz and Stegun 4.4.46. Adds and multiplies only, but for one root,
/// so that it is the same on every host and fast in bulk.
fn angle(cos: f32) -> f32 {
    const FACTORS: [f32; 8] = [
        1.570_796_3,
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

impl<'s> Objective<'s> {
    /// Sets up the clients: `resolution` squared directions (a multiple of four along a side) around every point.
    pub fn new(survey: &'s Survey, resolution: u32) -> Self {
        let directions = octahedral::directions(resolution);
        let axes = [0, 1, 2].map(|axis| directions.iter().map(|d| d[axis] as f32).collect::<Vec<f32>>());
        let texels = directions.len();
        let mut reach = vec![false; survey.points.len() * texels];
        let near = REACH_DEG.to_radians().cos() as f32;
        in_parallel(&mut reach, texels, |point, reach| {
            for photo in survey.sight.seers(point) {
                let n = survey.direction(point, photo);
                for (t, reach) in reach.iter_mut().enumerate() {
                    *reach |= dot(&axes, t, n) > near;
                }
            }
        });
        let counts: Vec<usize> = reach.chunks(texels).map(|row| row.iter().filter(|r| **r).count()).collect();
        let scores = survey.points.iter().zip(&counts).filter(|(_, count)| **count > 0).map(|(p, _)| p.score);
        let all: f64 = scores.map(f64::from).sum();
        let share = |point: usize| f64::from(survey.points[point].score) / all;
        let of = |weight: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            let weigh = |(point, &count)| if count > 0 { weight(point, count) } else { 0.0 };
            counts.iter().enumerate().map(weigh).collect()
        };
        Self {
            seen: survey.sight.by_photo(),
            texel_weight: of(&|point, count| share(point) / count as f64),
            price: vec![0.0; survey.sight.photos],
            survey,
            axes,
            reach,
        }
    }

    /// The same with a price on each photo.
    pub fn with_prices(self, price: Vec<f64>) -> Self {
        Self { price, ..self }
    }

    /// Texels along a side.
    pub fn resolution(&self) -> u32 {
        self.texels().isqrt() as u32
    }

    fn texels(&self) -> usize {
        self.axes[0].len()
    }

    /// Bytes that the clients and a choice take.
    pub fn bytes(&self) -> usize {
        let lists: usize = self.seen.iter().map(|list| 4 * list.len()).sum();
        // A cosine, four angles and four slots to a client, and whether it counts.
        self.reach.len() * (4 * (1 + 2 * KEPT) + 1) + lists
    }

    /// Nothing chosen yet.
    pub fn empty(&self) -> Choice<'_, 's> {
        self.choose(&[])
    }

    /// These photos chosen, in slots of this order.
    pub fn choose(&self, photos: &[usize]) -> Choice<'_, 's> {
        let (texels, points) = (self.texels(), self.survey.points.len());
        let nearest = Nearest {
            bar: vec![NONE; texels],
            angle: vec![[PI; KEPT]; texels],
            slot: vec![[NO_SLOT; KEPT]; texels],
            cost: 0.0,
        };
        let points = vec![nearest; points];
        let mut choice = Choice { objective: self, chosen: photos.to_vec(), points, losses: Vec::new() };
        choice.renew(|_| true);
        choice
    }
}

fn dot(axes: &[Vec<f32>; 3], t: usize, n: Vec3) -> f32 {
    axes[0][t] * n.x + axes[1][t] * n.y + axes[2][t] * n.z
}

impl Nearest {
    /// Finds the nearest of the chosen photos from scratch.
    fn renew(&mut self, objective: &Objective<'_>, point: usize, chosen: &[usize], best: &mut Best) {
        let texels = objective.texels();
        let reach = &objective.reach[point * texels..(point + 1) * texels];
        best.cos.iter_mut().for_each(|cos| cos.fill(NONE));
        best.slot.iter_mut().for_each(|slot| slot.fill(NO_SLOT));
        for (slot, &photo) in (0u32..).zip(chosen) {
            if objective.survey.sight.sees(point, photo) {
                let n = objective.survey.direction(point, photo);
                for t in 0..texels {
                    best.moved[t] = dot(&objective.axes, t, n);
                }
                best.insert(slot);
            }
        }
        let mut sum = 0.0;
        for (t, reach) in reach.iter().enumerate() {
            for k in 0..KEPT {
                let cos = best.cos[k][t];
                self.slot[t][k] = best.slot[k][t];
                self.angle[t][k] = if cos == NONE { PI } else { angle(cos) };
            }
            self.bar[t] = if *reach { best.cos[KEPT - 1][t] } else { OUT };
            if *reach {
                sum += f64::from(expected(without(&self.angle[t], COUNTED)));
            } else {
                self.slot[t] = [NO_SLOT; KEPT];
            }
        }
        self.cost = objective.texel_weight[point] * sum;
    }
}

/// Scratch of [`Nearest::renew`]: for every rank and texel, cosine and slot; and what is being put in.
struct Best {
    cos: [Vec<f32>; KEPT],
    slot: [Vec<u32>; KEPT],
    moved: Vec<f32>,
}

impl Best {
    fn new(texels: usize) -> Self {
        Self {
            cos: std::array::from_fn(|_| vec![NONE; texels]),
            slot: std::array::from_fn(|_| vec![NO_SLOT; texels]),
            moved: vec![NONE; texels],
        }
    }

    /// Puts the cosines in `moved`, of the photo in `slot`, where they belong; equal ones stay behind those that were there.
    fn insert(&mut self, slot: u32) {
        let mut slots = vec![slot; self.moved.len()];
        for (cos, slot) in self.cos.iter_mut().zip(&mut self.slot) {
            for (((cos, slot), moved), moved_slot) in cos.iter_mut().zip(slot).zip(&mut self.moved).zip(&mut slots) {
                let nearer = *moved > *cos;
                let (old, old_slot) = (*cos, *slot);
                *cos = if nearer { *moved } else { old };
                *slot = if nearer { *moved_slot } else { old_slot };
                *moved = if nearer { old } else { *moved };
                *moved_slot = if nearer { old_slot } else { *moved_slot };
            }
        }
    }
}

impl Choice<'_, '_> {
    /// The chosen photos, by slot.
    pub fn chosen(&self) -> &[usize] {
        &self.chosen
    }

    /// Rise of the cost if the photo of each slot were removed.
    pub fn losses(&self) -> &[f64] {
        &self.losses
    }

    /// The cost: radians, and the prices of the photos.
    pub fn cost(&self) -> f64 {
        let prices: f64 = self.chosen.iter().map(|photo| self.objective.price[*photo]).sum();
        self.points.iter().map(|point| point.cost).sum::<f64>() + prices
    }

    fn renew(&mut self, touched: impl Fn(usize) -> bool + Sync) {
        let (objective, chosen) = (self.objective, &self.chosen);
        let scratch = || Best::new(objective.texels());
        with_scratch(&mut self.points, 1, scratch, |point, nearest, best| {
            if touched(point) {
                nearest[0].renew(objective, point, chosen, best);
            }
        });
        self.losses = self.chosen.iter().map(|photo| -objective.price[*photo]).collect();
        for (nearest, weight) in self.points.iter().zip(&objective.texel_weight) {
            for (angles, slots) in nearest.angle.iter().zip(&nearest.slot) {
                let now = expected(without(angles, COUNTED));
                for (k, slot) in slots.iter().take(COUNTED).enumerate().filter(|(_, slot)| **slot != NO_SLOT) {
                    self.losses[*slot as usize] += weight * f64::from(expected(without(angles, k)) - now);
                }
            }
        }
    }

    /// Adds a photo in a new slot.
    pub fn add(&mut self, photo: usize) {
        self.chosen.push(photo);
        let sight = &self.objective.survey.sight;
        self.renew(|point| sight.sees(point, photo));
    }

    /// Puts a photo into a slot in place of the one that is there.
    pub fn replace(&mut self, slot: usize, photo: usize) {
        let old = std::mem::replace(&mut self.chosen[slot], photo);
        let sight = &self.objective.survey.sight;
        self.renew(|point| sight.sees(point, photo) || sight.sees(point, old));
    }

    /// Fall of the cost if a photo were added. `spared[r]` becomes how much less than its loss the removal of slot `r` would
    /// cost then (Resende and Werneck, "A fast swap-based local search procedure for location problems", 2007).
    pub fn gain(&self, photo: usize, spared: &mut [f64]) -> f64 {
        spared.fill(0.0);
        let objective = self.objective;
        let [x, y, z] = &objective.axes;
        let mut gain = -objective.price[photo];
        for &point in &objective.seen[photo] {
            let point = point as usize;
            let nearest = &self.points[point];
            let weight = objective.texel_weight[point];
            let n = objective.survey.direction(point, photo);
            for base in (0..objective.texels()).step_by(LANES) {
                let lanes = base..base + LANES;
                let (x, y, z) = (&x[lanes.clone()], &y[lanes.clone()], &z[lanes.clone()]);
                let bar = &nearest.bar[lanes];
                let mut cos = [0f32; LANES];
                let mut any = false;
                for lane in 0..LANES {
                    cos[lane] = x[lane] * n.x + y[lane] * n.y + z[lane] * n.z;
                    any |= cos[lane] > bar[lane];
                }
                if !any {
                    continue;
                }
                for lane in (0..LANES).filter(|lane| cos[*lane] > bar[*lane]) {
                    let t = base + lane;
                    let (angles, own) = (&nearest.angle[t], angle(cos[lane]));
                    let counted = without(angles, COUNTED);
                    let fall = expected(counted) - expected(with(counted, own));
                    gain += weight * f64::from(fall);
                    for (k, slot) in nearest.slot[t].iter().take(COUNTED).enumerate() {
                        if *slot != NO_SLOT {
                            let rest = without(angles, k);
                            let in_turn = expected(rest) - expected(with(rest, own));
                            spared[*slot as usize] += weight * f64::from(in_turn - fall);
                        }
                    }
                }
            }
        }
        gain
    }

    /// The best swap that brings `photo` in, among slots that may change; ties go to the first slot.
    pub fn best_swap(&self, photo: usize, fixed: &[bool], spared: &mut [f64]) -> Swap {
        let gain = self.gain(photo, spared);
        let mut best = Swap { change: f64::INFINITY, slot: 0 };
        for (slot, (loss, spared)) in self.losses.iter().zip(spared.iter()).enumerate() {
            let change = loss - spared - gain;
            if !fixed[slot] && change < best.change {
                best = Swap { change, slot };
            }
        }
        best
    }

    /// The best swap of each photo; in parallel, and the same however many threads there are.
    pub fn best_swaps(&self, photos: &[usize], fixed: &[bool]) -> Vec<Swap> {
        let mut swaps = vec![Swap { change: f64::INFINITY, slot: 0 }; photos.len()];
        let scratch = || vec![0.0; self.chosen.len()];
        with_scratch(&mut swaps, 1, scratch, |i, swap, spared| swap[0] = self.best_swap(photos[i], fixed, spared));
        swaps
    }

    /// The gain of adding each photo; as [`Choice::best_swaps`].
    pub fn gains(&self, photos: &[usize]) -> Vec<f64> {
        let mut gains = vec![0.0; photos.len()];
        let scratch = || vec![0.0; self.chosen.len()];
        with_scratch(&mut gains, 1, scratch, |i, gain, spared| gain[0] = self.gain(photos[i], spared));
        gains
    }
}
