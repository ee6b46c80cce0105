//! What is minimised over subsets of a pool: the angular gap on the real frusta, exactly.
//!
//! For a point `p` and a direction `w` in which the pool can show it, the cost is the angle from `w` to the nearest chosen
//! photo that sees `p`, and pi where none does: a facility location (k-median) problem, whose facilities are photos and
//! whose clients are pairs of point and direction. A point's cost is the mean over its directions, and the whole the mean
//! over points, weighted by their scores; a shortage is added for each view that a point lacks of three.

use std::sync::OnceLock;

use glam::Vec3;

use super::nearest::{Directions, Nearest};
use super::sight::Survey;
use crate::parallel::{in_parallel, with_scratch};
use crate::scene::octahedral;

/// A direction counts at a point where some photo of the pool that sees the point lies within this angle of it.
pub const REACH_DEG: f64 = 15.0;
/// Views that a point should have: two to triangulate, one to spare, as in the coverage metric.
pub const WANTED: u32 = 3;
/// What a point's lack of one view costs at first, in radians.
const SHORTAGE: f64 = 0.1;

/// Points that a thread takes together: a point alone is done in a microsecond.
const POINTS: usize = 64;

/// The clients: points and directions, with their weights.
#[derive(Clone)]
pub struct Objective<'s> {
    pub(super) survey: &'s Survey,
    /// Points that each photo sees.
    pub(super) seen: Vec<Vec<u32>>,
    /// Per point: the directions that count.
    directions: Vec<Directions>,
    /// Per point: weight of the angle in one of them.
    weight: Vec<f64>,
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
    points: Vec<Point>,
    /// Per slot: rise of the cost if its photo were removed. Taken when asked for: a greedy start never does.
    losses: OnceLock<Vec<f64>>,
}

/// One point's clients, and what they cost.
#[derive(Clone)]
struct Point {
    nearest: Nearest,
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

impl<'s> Objective<'s> {
    /// Sets up the clients: `resolution` squared directions (a multiple of four along a side) around every point.
    pub fn new(survey: &'s Survey, resolution: u32) -> Self {
        let texels: Vec<Vec3> = octahedral::directions(resolution).into_iter().map(|d| d.as_vec3()).collect();
        let near = REACH_DEG.to_radians().cos() as f32;
        let mut directions = vec![Directions::default(); survey.points.len()];
        in_parallel(&mut directions, 1, |point, directions| {
            let mut reach = vec![false; texels.len()];
            for photo in survey.sight.seers(point) {
                let n = survey.direction(point, photo);
                for (reach, w) in reach.iter_mut().zip(&texels) {
                    *reach |= w.x * n.x + w.y * n.y + w.z * n.z > near;
                }
            }
            let counting: Vec<Vec3> = texels.iter().zip(reach).filter(|(_, reach)| *reach).map(|(w, _)| *w).collect();
            directions[0] = Directions::new(&counting);
        });
        let counts: Vec<usize> = directions.iter().map(|directions| directions.count).collect();
        let scores = survey.points.iter().zip(&counts).filter(|(_, count)| **count > 0).map(|(p, _)| p.score);
        let all: f64 = scores.map(f64::from).sum();
        let share = |point: usize| f64::from(survey.points[point].score) / all;
        let of = |weight: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            let weigh = |(point, &count)| if count > 0 { weight(point, count) } else { 0.0 };
            counts.iter().enumerate().map(weigh).collect()
        };
        Self {
            seen: survey.sight.by_photo(),
            weight: of(&|point, count| share(point) / count as f64),
            lack: of(&|point, _| SHORTAGE * share(point)),
            price: vec![0.0; survey.sight.photos],
            survey,
            directions,
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

    /// Slot and photo of those of `chosen` that see a point.
    fn seers<'c>(&'c self, point: usize, chosen: &'c [usize]) -> impl Iterator<Item = (u32, usize)> + 'c {
        (0..).zip(chosen.iter().copied()).filter(move |(_, photo)| self.survey.sight.sees(point, *photo))
    }

    /// Bytes that the clients and a choice take.
    pub fn bytes(&self) -> usize {
        let lists: usize = self.seen.iter().map(|list| 4 * list.len()).sum();
        self.directions.iter().map(Directions::bytes).sum::<usize>() + lists
    }

    /// Nothing chosen yet.
    pub fn empty(&self) -> Choice<'_, 's> {
        self.choose(&[])
    }

    /// These photos chosen, in slots of this order.
    pub fn choose(&self, photos: &[usize]) -> Choice<'_, 's> {
        let point = |directions| Point { nearest: Nearest::new(directions), cost: 0.0 };
        let points = self.directions.iter().map(point).collect();
        let mut choice = Choice { objective: self, chosen: photos.to_vec(), points, losses: OnceLock::new() };
        let chosen = &choice.chosen;
        each_in_parallel(&mut choice.points, |index, point| {
            for (slot, photo) in self.seers(index, chosen) {
                point.nearest.insert(&self.directions[index], self.survey.direction(index, photo), slot);
            }
            point.settle(self, index, chosen);
        });
        choice
    }
}

/// Calls `work` with the index and the contents of every point.
fn each_in_parallel(points: &mut [Point], work: impl Fn(usize, &mut Point) + Sync) {
    in_parallel(points, POINTS, |chunk, points| {
        (chunk * POINTS..).zip(points).for_each(|(index, point)| work(index, point));
    });
}

impl Point {
    /// Takes note that `old`, where there was one, has given its slot to `new`; `chosen` is as it is after that.
    fn change(&mut self, objective: &Objective<'_>, index: usize, chosen: &[usize], slot: u32, old: Option<usize>) {
        let (survey, directions) = (objective.survey, &objective.directions[index]);
        if let Some(old) = old.filter(|old| survey.sight.sees(index, *old)) {
            let others = objective.seers(index, chosen).filter(|(other, _)| *other != slot);
            let others: Vec<_> = others.map(|(other, photo)| (other, survey.direction(index, photo))).collect();
            self.nearest.remove(directions, survey.direction(index, old), &others);
        }
        let new = chosen[slot as usize];
        if survey.sight.sees(index, new) {
            self.nearest.insert(directions, survey.direction(index, new), slot);
        }
        self.settle(objective, index, chosen);
    }

    /// Views, angles and cost.
    fn settle(&mut self, objective: &Objective<'_>, index: usize, chosen: &[usize]) {
        self.nearest.settle(objective.seers(index, chosen).map(|(slot, _)| slot));
        let lacking = f64::from(WANTED.saturating_sub(self.nearest.views));
        self.cost = objective.weight[index] * self.nearest.sum() + objective.lack[index] * lacking;
    }
}

impl Choice<'_, '_> {
    /// The chosen photos, by slot.
    pub fn chosen(&self) -> &[usize] {
        &self.chosen
    }

    /// Rise of the cost if the photo of each slot were removed.
    pub fn losses(&self) -> &[f64] {
        self.losses.get_or_init(|| {
            let objective = self.objective;
            let mut losses: Vec<f64> = self.chosen.iter().map(|photo| -objective.price[*photo]).collect();
            for (index, Point { nearest, .. }) in self.points.iter().enumerate() {
                let weight = objective.weight[index];
                nearest.losses().for_each(|(slot, farther)| losses[slot] += weight * f64::from(farther));
                if nearest.views <= WANTED {
                    for slot in &nearest.seers[..nearest.views as usize] {
                        losses[*slot as usize] += objective.lack[index];
                    }
                }
            }
            losses
        })
    }

    /// The cost: radians, and the prices of the photos.
    pub fn cost(&self) -> f64 {
        let prices: f64 = self.chosen.iter().map(|photo| self.objective.price[*photo]).sum();
        self.points.iter().map(|point| point.cost).sum::<f64>() + prices
    }

    fn change(&mut self, slot: usize, old: Option<usize>) {
        let (objective, chosen) = (self.objective, &self.chosen);
        let sees = |index: usize, photo: usize| objective.survey.sight.sees(index, photo);
        each_in_parallel(&mut self.points, |index, point| {
            if sees(index, chosen[slot]) || old.is_some_and(|old| sees(index, old)) {
                point.change(objective, index, chosen, slot as u32, old);
            }
        });
        self.losses.take();
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
        let mut gain = 0.0 - objective.price[photo];
        for &index in &objective.seen[photo] {
            let index = index as usize;
            let (nearest, directions) = (&self.points[index].nearest, &objective.directions[index]);
            let (weight, lack) = (objective.weight[index], objective.lack[index]);
            if nearest.views < WANTED {
                gain += lack;
            } else if nearest.views == WANTED {
                nearest.seers.iter().for_each(|slot| spared[*slot as usize] += lack);
            }
            let n = objective.survey.direction(index, photo);
            gain = nearest.gain(directions, n, weight, gain, spared);
        }
        gain
    }

    /// The best swap that brings `photo` in, among slots that may change; ties go to the first slot.
    pub fn best_swap(&self, photo: usize, fixed: &[bool], spared: &mut [f64]) -> Swap {
        let gain = self.gain(photo, spared);
        let mut best = Swap { change: f64::INFINITY, slot: 0 };
        for (slot, (loss, spared)) in self.losses().iter().zip(spared.iter()).enumerate() {
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
