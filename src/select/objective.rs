//! What is minimised over subsets of a pool: the angular gap on the real frusta, exactly.
//!
//! For a point `p` and a direction `w` in which the pool can show it, the cost is the angle from `w` to the nearest chosen
//! photo that sees `p`, and pi where none does: a facility location (k-median) problem, whose facilities are photos and
//! whose clients are pairs of point and direction. A point's cost is the mean over its directions, and the whole the mean
//! over points, weighted by their scores; a shortage is added for each view that a point lacks of three.

use std::f32::consts::PI;

use glam::Vec3;

use super::sight::Survey;
use crate::parallel::{in_parallel, with_scratch};
use crate::scene::octahedral;

/// A direction counts at a point where some photo of the pool that sees the point lies within this angle of it.
pub const REACH_DEG: f64 = 15.0;
/// Views that a point should have: two to triangulate, one to spare, as in the coverage metric.
pub const WANTED: u32 = 3;
/// What a point's lack of one view costs at first, in radians.
const SHORTAGE: f64 = 0.1;

/// Directions that are looked at together.
const LANES: usize = 16;
/// Cosine of no photo at all, and of a direction that does not count: below and above every cosine.
const NONE: f32 = -2.0;
const OUT: f32 = 2.0;
/// Slot of no photo.
const NO_SLOT: u32 = u32::MAX;

/// The clients: points and directions, with their weights.
#[derive(Clone)]
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
    /// Per point: cost of each view it lacks.
    lack: Vec<f64>,
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

/// One point's clients.
#[derive(Clone)]
struct Nearest {
    cos: [Vec<f32>; 2],
    angle: [Vec<f32>; 2],
    slot: Vec<u32>,
    /// Chosen photos that see the point, and the slots of the first few.
    views: u32,
    seers: [u32; WANTED as usize],
    cost: f64,
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
            lack: of(&|point, _| SHORTAGE * share(point)),
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

    /// Lacking views costs half as much again from now on.
    pub fn raise_shortage(&mut self) {
        self.lack.iter_mut().for_each(|lack| *lack *= 1.5);
    }

    /// Texels along a side.
    pub fn resolution(&self) -> u32 {
        self.texels().isqrt() as u32
    }

    /// Slot and photo of those of `chosen` that see a point.
    fn seers<'c>(&'c self, point: usize, chosen: &'c [usize]) -> impl Iterator<Item = (u32, usize)> + 'c {
        (0..).zip(chosen.iter().copied()).filter(move |(_, photo)| self.survey.sight.sees(point, *photo))
    }

    fn texels(&self) -> usize {
        self.axes[0].len()
    }

    /// Bytes that the clients and a choice take.
    pub fn bytes(&self) -> usize {
        let lists: usize = self.seen.iter().map(|list| 4 * list.len()).sum();
        // Two cosines, two angles and a slot to a client, and whether it counts.
        self.reach.len() * (5 * 4 + 1) + lists
    }

    /// Nothing chosen yet.
    pub fn empty(&self) -> Choice<'_, 's> {
        self.choose(&[])
    }

    /// These photos chosen, in slots of this order.
    pub fn choose(&self, photos: &[usize]) -> Choice<'_, 's> {
        let (texels, points) = (self.texels(), self.survey.points.len());
        let nearest = Nearest {
            cos: [vec![NONE; texels], vec![NONE; texels]],
            angle: [vec![PI; texels], vec![PI; texels]],
            slot: vec![NO_SLOT; texels],
            views: 0,
            seers: [NO_SLOT; WANTED as usize],
            cost: 0.0,
        };
        let points = vec![nearest; points];
        let mut choice = Choice { objective: self, chosen: photos.to_vec(), points, losses: Vec::new() };
        in_parallel(&mut choice.points, 1, |point, nearest| nearest[0].renew(self, point, photos));
        choice.tally();
        choice
    }
}

fn dot(axes: &[Vec<f32>; 3], t: usize, n: Vec3) -> f32 {
    axes[0][t] * n.x + axes[1][t] * n.y + axes[2][t] * n.z
}

impl Nearest {
    /// Finds the two nearest of the chosen photos from scratch.
    fn renew(&mut self, objective: &Objective<'_>, point: usize, chosen: &[usize]) {
        let texels = objective.texels();
        for (t, reach) in objective.reach[point * texels..(point + 1) * texels].iter().enumerate() {
            self.clear(t, if *reach { NONE } else { OUT });
        }
        for (slot, photo) in objective.seers(point, chosen) {
            self.insert(objective, objective.survey.direction(point, photo), slot);
        }
        self.settle(objective, point, chosen);
    }

    /// Takes note that `old`, where there was one, has given its slot to `new`; `chosen` is as it is after that. Only the
    /// texels that `old` was one of the two nearest to are searched again.
    fn change(&mut self, objective: &Objective<'_>, point: usize, chosen: &[usize], slot: u32, old: Option<usize>) {
        let survey = objective.survey;
        if let Some(old) = old.filter(|old| survey.sight.sees(point, *old)) {
            let n = survey.direction(point, old);
            // The same cosine as when it was put in, to the bit. What does not count is above all cosines.
            let lost: Vec<usize> =
                (0..objective.texels()).filter(|t| dot(&objective.axes, *t, n) >= self.cos[1][*t]).collect();
            lost.iter().for_each(|t| self.clear(*t, NONE));
            for (other, photo) in objective.seers(point, chosen).filter(|(other, _)| *other != slot) {
                let n = survey.direction(point, photo);
                for &t in &lost {
                    self.offer(t, dot(&objective.axes, t, n), other);
                }
            }
        }
        let new = chosen[slot as usize];
        if survey.sight.sees(point, new) {
            self.insert(objective, survey.direction(point, new), slot);
        }
        self.settle(objective, point, chosen);
    }

    fn clear(&mut self, t: usize, cos: f32) {
        self.cos.iter_mut().for_each(|all| all[t] = cos);
        self.slot[t] = NO_SLOT;
    }

    fn insert(&mut self, objective: &Objective<'_>, n: Vec3, slot: u32) {
        for t in 0..objective.texels() {
            self.offer(t, dot(&objective.axes, t, n), slot);
        }
    }

    /// Without branches, so that it goes through many texels at once.
    fn offer(&mut self, t: usize, cos: f32, slot: u32) {
        let [first, second] = &mut self.cos;
        let nearer = cos > first[t];
        second[t] = if nearer { first[t] } else { second[t].max(cos) };
        self.slot[t] = if nearer { slot } else { self.slot[t] };
        first[t] = if nearer { cos } else { first[t] };
    }

    /// Views, angles and cost.
    fn settle(&mut self, objective: &Objective<'_>, point: usize, chosen: &[usize]) {
        (self.views, self.seers) = (0, [NO_SLOT; WANTED as usize]);
        for (slot, _) in objective.seers(point, chosen) {
            if let Some(seer) = self.seers.get_mut(self.views as usize) {
                *seer = slot;
            }
            self.views += 1;
        }
        for (cos, out) in self.cos.iter().zip(&mut self.angle) {
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
        let sum: f64 = self.angle[0].iter().map(|a| f64::from(*a)).sum();
        let lacking = f64::from(WANTED.saturating_sub(self.views));
        self.cost = objective.texel_weight[point] * sum + objective.lack[point] * lacking;
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

    /// Rises of the cost if photos were removed, after all points have been brought up to date.
    fn tally(&mut self) {
        let objective = self.objective;
        self.losses = self.chosen.iter().map(|photo| -objective.price[*photo]).collect();
        for (point, nearest) in self.points.iter().enumerate() {
            let weight = objective.texel_weight[point];
            for ((slot, first), second) in nearest.slot.iter().zip(&nearest.angle[0]).zip(&nearest.angle[1]) {
                if *slot != NO_SLOT {
                    self.losses[*slot as usize] += weight * f64::from(second - first);
                }
            }
            if nearest.views <= WANTED {
                for slot in &nearest.seers[..nearest.views as usize] {
                    self.losses[*slot as usize] += objective.lack[point];
                }
            }
        }
    }

    fn change(&mut self, slot: usize, old: Option<usize>) {
        let (objective, chosen) = (self.objective, &self.chosen);
        let sees = |point: usize, photo: usize| objective.survey.sight.sees(point, photo);
        in_parallel(&mut self.points, 1, |point, nearest| {
            if sees(point, chosen[slot]) || old.is_some_and(|old| sees(point, old)) {
                nearest[0].change(objective, point, chosen, slot as u32, old);
            }
        });
        self.tally();
    }

    /// Adds a photo in a new slot.
    pub fn add(&mut self, photo: usize) {
        self.chosen.push(photo);
        self.change(self.chosen.len() - 1, None);
    }

    /// Puts a photo into a slot in place of the one that is there.
    pub fn replace(&mut self, slot: usize, photo: usize) {
        let old = std::mem::replace(&mut self.chosen[slot], photo);
        self.change(slot, Some(old));
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
            if nearest.views < WANTED {
                gain += objective.lack[point];
            } else if nearest.views == WANTED {
                nearest.seers.iter().for_each(|slot| spared[*slot as usize] += objective.lack[point]);
            }
            let n = objective.survey.direction(point, photo);
            for base in (0..objective.texels()).step_by(LANES) {
                let lanes = base..base + LANES;
                let (x, y, z) = (&x[lanes.clone()], &y[lanes.clone()], &z[lanes.clone()]);
                let second = &nearest.cos[1][lanes];
                let mut cos = [0f32; LANES];
                let mut any = false;
                for lane in 0..LANES {
                    cos[lane] = x[lane] * n.x + y[lane] * n.y + z[lane] * n.z;
                    any |= cos[lane] > second[lane];
                }
                if !any {
                    continue;
                }
                for lane in (0..LANES).filter(|lane| cos[*lane] > second[*lane]) {
                    let t = base + lane;
                    let (first, second) = (nearest.angle[0][t], nearest.angle[1][t]);
                    let own = angle(cos[lane]);
                    if own < first {
                        gain += weight * f64::from(first - own);
                    }
                    if nearest.slot[t] != NO_SLOT {
                        spared[nearest.slot[t] as usize] += weight * f64::from(second - own.max(first)).max(0.0);
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
