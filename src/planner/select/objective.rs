//! What is minimised over subsets of a pool: the expected error of what viewers look at, on the real frusta.
//!
//! A viewer's cost is ten times the decimal logarithm of the mean expected error of its looks, each by its three nearest chosen photos
//! ([`crate::planner::quality::law`]); that of a subset is the mean over viewers, in decibels. For every candidate and slot the cost of the swap is
//! exact, but for photos at the very same angle. All that a candidate changes is at the looks that it sees: the worth of all its swaps comes from one pass over
//! these, and one over slots for each viewer that has any of them.

use std::ops::{ControlFlow, Range};
use std::sync::{Arc, OnceLock};

use glam::Vec3;

use super::sight::{Sight, sight_of};
use crate::engine::parallel::{in_parallel, mapped, with_scratch};
use crate::engine::vulkan::Context;
use crate::files::photos::Photo;
use crate::planner::quality::expected::MIN_SHOWN;
use crate::planner::quality::law::{FARTHEST, Law};
use crate::planner::quality::look::Look;
use crate::planner::quality::nearest::{angle, vectors};
use crate::visibility::device_scene::DeviceScene;
use crate::{Error, Result};

/// Looks that a thread takes together.
const TOGETHER: usize = 64;
/// Photos that are kept of a look: the law takes three, and one comes after them when one goes.
const KEPT: usize = 4;
/// Ratios of a viewer's errors that are multiplied before a logarithm is taken: so many stay within double precision.
const FACTORS: usize = 32;
/// Decibels of a natural logarithm.
const DECIBELS: f64 = 10.0 / std::f64::consts::LN_10;

/// The looks, and which photos see them.
#[derive(Clone)]
pub struct Objective {
    looks: Vec<Look>,
    /// The looks of each viewer that sees enough.
    viewers: Vec<Range<usize>>,
    sight: Sight,
    /// Looks that each photo sees, ascending.
    seen: Vec<Vec<u32>>,
    centres: Vec<Vec3>,
    /// Tangents of half the wider fields of view of the photos.
    widest: Vec<f64>,
    law: Law,
    /// Per photo: what choosing it costs by itself (its lack of sharpness), in decibels.
    price: Vec<f64>,
}

/// A chosen photo that sees a look.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Near {
    slot: u32,
    /// Angle at the point between photo and viewer.
    angle: f64,
    /// Logarithm of the photo's footprint over the viewer's.
    log_ratio: f64,
}

/// The nearest chosen photos of a look, nearest first, and the error that follows.
#[derive(Clone, Copy, Debug, PartialEq)]
struct State {
    near: [Near; KEPT],
    error: f64,
}

/// A subset, and what is known of it.
pub struct Choice<'o> {
    objective: &'o Objective,
    /// The photo in each slot.
    chosen: Vec<usize>,
    states: Vec<State>,
    removals: OnceLock<Removals>,
}

/// What the removal of each slot does.
struct Removals {
    /// By viewer and slot: rise of the sum of errors.
    rise: Vec<f64>,
    /// By slot: rise of the logarithm of that sum, over all viewers.
    total: Vec<f64>,
    /// By viewer: the sum of errors as it is.
    sums: Vec<f64>,
}

/// A swap: how the cost changes, and which slot gets the new photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swap {
    /// Change of the cost in decibels; negative is better.
    pub change: f64,
    /// The slot whose photo goes.
    pub slot: usize,
}

/// No photo.
const NONE: Near = Near { slot: u32::MAX, angle: FARTHEST, log_ratio: 0.0 };

impl Objective {
    /// Computes which photos see what `viewers` viewers look at, whose looks are consecutive, as many of each.
    ///
    /// # Errors
    /// Where device memory runs out or the device fails.
    pub fn new(
        context: &Arc<Context>,
        scene: &DeviceScene,
        photos: &[Photo],
        looks: Vec<Look>,
        viewers: usize,
        law: Law,
    ) -> Result<Self> {
        let each = looks.len() / viewers.max(1);
        // Looks at nothing count for nothing, as they do in the judge.
        let (mut counted, mut ranges) = (Vec::new(), Vec::new());
        for of_viewer in looks.chunks(each.max(1)) {
            let first = counted.len();
            let shown = of_viewer.iter().filter(|look| look.normal != [0.0; 3]).count();
            if shown >= MIN_SHOWN as usize {
                counted.extend(of_viewer.iter().filter(|look| look.distance > 0.0));
                ranges.push(first..counted.len());
            }
        }
        let (sight, centres) = sight_of(context, scene, photos, &counted)?;
        let seen = sight.by_photo();
        let widest = photos.iter().map(|photo| photo.camera.intrinsics.widest()).collect();
        let price = vec![0.0; photos.len()];
        Ok(Self { looks: counted, viewers: ranges, sight, seen, centres, widest, law, price })
    }

    /// The same with a price in decibels on each photo.
    pub fn with_prices(self, price: Vec<f64>) -> Self {
        Self { price, ..self }
    }

    /// Looks that count.
    pub fn looks(&self) -> usize {
        self.looks.len()
    }

    /// Bytes of the looks and their visibility.
    pub fn bytes(&self) -> usize {
        let lists: usize = self.seen.iter().map(|list| 4 * list.len()).sum();
        size_of_val(&self.looks[..]) + self.sight.bytes() + lists
    }

    /// A photo that sees a look, with its angle and footprint; none where it is too far off to count.
    fn near(&self, look: usize, photo: usize, slot: u32) -> Option<Near> {
        let of = &self.looks[look];
        let [point, to_viewer, _] = vectors(of);
        let ray = self.centres[photo].as_dvec3() - point;
        let distance = ray.length().max(1e-6);
        let angle = angle(to_viewer, ray / distance);
        let footprint = distance * self.widest[photo];
        (angle < FARTHEST).then(|| Near { slot, angle, log_ratio: (footprint / f64::from(of.footprint)).ln() })
    }

    /// Weighted error of a look by its three nearest.
    fn error(&self, look: usize, near: &[Near]) -> f64 {
        let error = self.law.of(std::array::from_fn(|k| near[k].angle), near[0].log_ratio);
        f64::from(self.looks[look].weight) * error
    }

    fn state(&self, look: usize, chosen: &[usize]) -> State {
        let mut near = [NONE; KEPT];
        for (slot, photo) in (0..).zip(chosen) {
            if self.sight.sees(look, *photo)
                && let Some(new) = self.near(look, *photo, slot)
            {
                near = with(&near, new);
            }
        }
        State { error: self.error(look, &near), near }
    }

    /// The photos `chosen` and, of `free`, as many more as make `count`: one after another that which lowers the cost most, of equals the
    /// first. `go_on` is asked before each.
    ///
    /// # Errors
    /// [`Error::Interrupted`] where it was stopped.
    pub fn grown(
        &self,
        chosen: &[usize],
        free: &[usize],
        count: usize,
        go_on: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Vec<usize>> {
        let (mut choice, mut left) = (self.choose(chosen), free.to_vec());
        while choice.chosen.len() < count && !left.is_empty() {
            Error::unless_stopped(go_on())?;
            let sums = choice.sums();
            let gains = mapped(&left, |_, photo| choice.gain(*photo, &sums));
            let best = (0..left.len()).fold(0, |best, i| if gains[i] > gains[best] { i } else { best });
            choice.add(left.remove(best));
        }
        Ok(choice.chosen)
    }

    /// These photos chosen, in slots of this order.
    pub fn choose(&self, photos: &[usize]) -> Choice<'_> {
        let mut states = vec![State { near: [NONE; KEPT], error: 0.0 }; self.looks.len()];
        in_parallel(&mut states, TOGETHER, |chunk, states| {
            let looks = chunk * TOGETHER..;
            looks.zip(states).for_each(|(look, state)| *state = self.state(look, photos));
        });
        Choice { objective: self, chosen: photos.to_vec(), states, removals: OnceLock::new() }
    }
}

/// The nearest with one more; of equal angles the earlier stays first.
fn with(near: &[Near; KEPT], new: Near) -> [Near; KEPT] {
    let mut all = *near;
    let place = near.iter().take_while(|other| other.angle <= new.angle).count();
    if place < KEPT {
        all[place..].rotate_right(1);
        all[place] = new;
    }
    all
}

/// The nearest without the one in place `k`.
fn without(near: &[Near; KEPT], k: usize) -> [Near; KEPT] {
    let mut others = *near;
    others[k..].rotate_left(1);
    others[KEPT - 1] = NONE;
    others
}

impl Choice<'_> {
    /// The chosen photos, by slot.
    pub fn chosen(&self) -> &[usize] {
        &self.chosen
    }

    /// The cost in decibels: the mean over viewers, and the prices of the photos.
    pub fn cost(&self) -> f64 {
        let objective = self.objective;
        let prices: f64 = self.chosen.iter().map(|photo| objective.price[*photo]).sum();
        let of = |range: &Range<usize>| {
            let sum: f64 = self.states[range.clone()].iter().map(|state| state.error).sum();
            DECIBELS * (sum / range.len() as f64).ln()
        };
        objective.viewers.iter().map(of).sum::<f64>() / objective.viewers.len().max(1) as f64 + prices
    }

    /// By viewer: the sum of errors.
    fn sums(&self) -> Vec<f64> {
        let sum = |range: &Range<usize>| self.states[range.clone()].iter().map(|state| state.error).sum();
        self.objective.viewers.iter().map(sum).collect()
    }

    /// By how many decibels the cost falls with one more photo, beside these sums.
    fn gain(&self, photo: usize, sums: &[f64]) -> f64 {
        let objective = self.objective;
        let mut seen = objective.seen[photo].iter().map(|look| *look as usize).peekable();
        let mut log = 0.0;
        for (range, sum) in objective.viewers.iter().zip(sums) {
            let mut change = 0.0;
            while let Some(look) = seen.next_if(|look| *look < range.end) {
                let State { near, error } = &self.states[look];
                if let Some(new) = objective.near(look, photo, u32::MAX - 1) {
                    change += objective.error(look, &with(near, new)) - error;
                }
            }
            log += (change / sum).ln_1p();
        }
        -DECIBELS * log / objective.viewers.len().max(1) as f64 - objective.price[photo]
    }

    /// One more photo, in a slot of its own.
    fn add(&mut self, photo: usize) {
        let (objective, slot) = (self.objective, self.chosen.len() as u32);
        for look in objective.seen[photo].iter().map(|look| *look as usize) {
            if let Some(new) = objective.near(look, photo, slot) {
                let near = with(&self.states[look].near, new);
                self.states[look] = State { error: objective.error(look, &near), near };
            }
        }
        self.chosen.push(photo);
        self.removals.take();
    }

    fn removals(&self) -> &Removals {
        self.removals.get_or_init(|| {
            let (objective, slots) = (self.objective, self.chosen.len());
            let viewers = &objective.viewers;
            let mut rise = vec![0.0; viewers.len() * slots];
            in_parallel(&mut rise, slots, |viewer, rise| {
                for look in viewers[viewer].clone() {
                    let State { near, error } = &self.states[look];
                    for k in (0..3).filter(|k| near[*k] != NONE) {
                        rise[near[k].slot as usize] += objective.error(look, &without(near, k)) - error;
                    }
                }
            });
            let sums = self.sums();
            let log: Vec<f64> = rise.iter().enumerate().map(|(i, rise)| (rise / sums[i / slots]).ln_1p()).collect();
            let mut total = vec![0.0; slots];
            log.chunks(slots.max(1))
                .for_each(|of_viewer| total.iter_mut().zip(of_viewer).for_each(|(sum, log)| *sum += log));
            Removals { rise, total, sums }
        })
    }

    /// Rise of the cost in decibels if the photo of each slot were removed.
    pub fn losses(&self) -> Vec<f64> {
        let objective = self.objective;
        let share = DECIBELS / objective.viewers.len().max(1) as f64;
        self.removals()
            .total
            .iter()
            .zip(&self.chosen)
            .map(|(log, photo)| share * log - objective.price[*photo])
            .collect()
    }

    /// Puts a photo into a slot in place of the one that is there.
    pub fn replace(&mut self, slot: usize, photo: usize) {
        let old = std::mem::replace(&mut self.chosen[slot], photo);
        let (objective, chosen) = (self.objective, &self.chosen);
        in_parallel(&mut self.states, TOGETHER, |chunk, states| {
            for (look, state) in (chunk * TOGETHER..).zip(states) {
                if objective.sight.sees(look, old) || objective.sight.sees(look, photo) {
                    *state = objective.state(look, chosen);
                }
            }
        });
        self.removals.take();
    }

    /// The best swap that brings `photo` in, among slots that may change; ties go to the first slot. `scratch` has capacity for
    /// as many slots.
    pub fn best_swap(&self, photo: usize, fixed: &[bool], scratch: &mut Scratch) -> Swap {
        let (objective, slots) = (self.objective, self.chosen.len());
        let Removals { rise, total, sums } = self.removals();
        let Scratch { change, moved, product } = scratch;
        change.copy_from_slice(total);
        product.fill(1.0);
        let (mut seen, mut multiplied) = (objective.seen[photo].iter().map(|look| *look as usize).peekable(), 0);
        for (viewer, range) in objective.viewers.iter().enumerate() {
            let mut added = 0.0;
            moved.fill(0.0);
            let mut touched = false;
            while let Some(look) = seen.next_if(|look| *look < range.end) {
                let State { near, error } = &self.states[look];
                let Some(new) = objective.near(look, photo, u32::MAX - 1) else { continue };
                // Farther than the fourth it counts for nothing, whichever of the three goes.
                if new.angle >= near[3].angle && near[3] != NONE {
                    continue;
                }
                touched = true;
                let closer = with(near, new);
                let all = objective.error(look, &closer);
                added += all - error;
                for k in (0..3).filter(|k| near[*k] != NONE) {
                    let gone = objective.error(look, &without(near, k)) - error;
                    let swapped = objective.error(look, &with(&without(near, k), new)) - all;
                    moved[near[k].slot as usize] += swapped - gone;
                }
            }
            if touched {
                let row = &rise[viewer * slots..(viewer + 1) * slots];
                for ((product, rise), moved) in product.iter_mut().zip(row).zip(moved.iter()) {
                    *product *= 1.0 + (added + moved) / (sums[viewer] + rise);
                }
                multiplied += 1;
                if multiplied % FACTORS == 0 {
                    fold(change, product);
                }
            }
        }
        fold(change, product);
        let share = DECIBELS / objective.viewers.len().max(1) as f64;
        let mut best = Swap { change: f64::INFINITY, slot: 0 };
        for (slot, log) in change.iter().enumerate() {
            let change = share * log + objective.price[photo] - objective.price[self.chosen[slot]];
            if !fixed[slot] && change < best.change {
                best = Swap { change, slot };
            }
        }
        best
    }

    /// The best swap of each photo; in parallel, and the same however many threads there are.
    pub fn best_swaps(&self, photos: &[usize], fixed: &[bool]) -> Vec<Swap> {
        self.removals();
        let mut swaps = vec![Swap { change: f64::INFINITY, slot: 0 }; photos.len()];
        let scratch = || Scratch::new(self.chosen.len());
        with_scratch(&mut swaps, 1, scratch, |i, swap, scratch| swap[0] = self.best_swap(photos[i], fixed, scratch));
        swaps
    }
}

/// Adds the logarithms of products to what they change, and begins them anew.
fn fold(change: &mut [f64], product: &mut [f64]) {
    for (change, product) in change.iter_mut().zip(product) {
        *change += product.ln();
        *product = 1.0;
    }
}

/// Scratch memory of [`Choice::best_swap`].
pub struct Scratch {
    change: Vec<f64>,
    moved: Vec<f64>,
    product: Vec<f64>,
}

impl Scratch {
    /// For so many slots.
    pub fn new(slots: usize) -> Self {
        Self { change: vec![0.0; slots], moved: vec![0.0; slots], product: vec![1.0; slots] }
    }
}
