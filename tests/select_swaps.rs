//! What swaps are chosen by, against a plain reference that keeps nothing: the same numbers and the same choice, to the bit.

use std::f32::consts::PI;

use camsplat::scene::octahedral;
use camsplat::scene::proxy::SurfacePoint;
use camsplat::scene::random;
use camsplat::select::interchange::{grow, refine};
use camsplat::select::objective::{Objective, REACH_DEG};
use camsplat::select::sight::{Sight, Survey};
use camsplat::visibility::probe_depth::Probe;
use glam::{DVec3, Vec3};

/// Points on a small ball and photos on a large one, three of them in the same place. Most points are seen from outside, some
/// from all sides, some hardly or not at all; one time in five a ray that is free is blocked.
fn survey(seed: u64, points: usize, photos: usize) -> Survey {
    let drawn = |stream, i: usize| random::uniforms(seed, stream, i as u32);
    let normals: Vec<DVec3> = (0..points).map(|i| random::direction(drawn(1, i)[0], drawn(1, i)[1])).collect();
    let outward = |i: usize| random::direction(drawn(2, i)[0], drawn(2, i)[1]);
    let centres: Vec<Vec3> = (0..photos).map(|i| 1.5 * outward(if i < 3 { 0 } else { i }).as_vec3()).collect();
    let words = photos.div_ceil(64) * 2;
    let mut bits = vec![0; points * words];
    for (point, normal) in normals.iter().enumerate() {
        let lowest = [0.1, 0.1, 0.1, -2.0, 0.9, 2.0][point % 6];
        for (photo, centre) in centres.iter().enumerate() {
            let free = drawn(3, point * photos + photo)[0] > 0.2;
            if free && normal.dot(centre.normalize().as_dvec3()) > lowest {
                bits[point * words + photo / 32] |= 1 << (photo % 32);
            }
        }
    }
    let point = |(i, normal): (usize, &DVec3)| SurfacePoint {
        position: 0.3 * *normal,
        normal: *normal,
        radius: 0.01,
        lift: 0.0,
        colour: [0; 3],
        score: 1.0 + drawn(4, i)[0] as f32,
        lobe: [0.0; 8],
    };
    Survey {
        points: normals.iter().enumerate().map(point).collect(),
        probes: normals.iter().map(|n| Probe { position: (0.3 * *n).as_vec3().into(), ..Probe::default() }).collect(),
        centres,
        sight: Sight { photos, words, bits },
    }
}

/// The formulas as they stand in the documentation, worked out anew each time.
struct Reference<'s> {
    survey: &'s Survey,
    /// Per point: the directions that count.
    directions: Vec<Vec<Vec3>>,
    weight: Vec<f64>,
    lack: Vec<f64>,
    price: Vec<f64>,
}

/// A direction's two nearest photos: the angles to them, the cosine of the second, and who is the first.
struct Client {
    first: f32,
    second: f32,
    bar: f32,
    slot: Option<usize>,
}

fn dot(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Abramowitz and Stegun 4.4.46.
fn angle(cos: f32) -> f32 {
    let factors = [
        -0.001_262_491_1,
        0.006_670_09,
        -0.017_088_126,
        0.030_891_88,
        -0.050_174_305,
        0.088_978_99,
        -0.214_598_8,
        std::f32::consts::FRAC_PI_2,
    ];
    let x = cos.abs().min(1.0);
    let acute = (1.0 - x).sqrt() * factors.iter().fold(0.0, |sum, factor| sum * x + factor);
    if cos < 0.0 { PI - acute } else { acute }
}

impl<'s> Reference<'s> {
    fn new(survey: &'s Survey, resolution: u32, price: Vec<f64>) -> Self {
        let near = REACH_DEG.to_radians().cos() as f32;
        let counting = |point: usize| {
            let reached = |w: &Vec3| survey.sight.seers(point).any(|i| dot(*w, survey.direction(point, i)) > near);
            octahedral::directions(resolution).into_iter().map(|w| w.as_vec3()).filter(reached).collect()
        };
        let directions: Vec<Vec<Vec3>> = (0..survey.points.len()).map(counting).collect();
        let counted = || survey.points.iter().zip(&directions).map(|(p, all)| (f64::from(p.score), all.len()));
        let all: f64 = counted().filter(|(_, count)| *count > 0).map(|(score, _)| score).sum();
        let weight = |(score, count)| if count > 0 { score / all / count as f64 } else { 0.0 };
        let lack = |(score, count)| if count > 0 { 0.1 * (score / all) } else { 0.0 };
        Self { weight: counted().map(weight).collect(), lack: counted().map(lack).collect(), survey, directions, price }
    }

    fn seers(&self, point: usize, chosen: &[usize]) -> Vec<usize> {
        (0..chosen.len()).filter(|slot| self.survey.sight.sees(point, chosen[*slot])).collect()
    }

    fn clients(&self, point: usize, chosen: &[usize]) -> Vec<Client> {
        let seers = self.seers(point, chosen);
        let client = |w: &Vec3| {
            let near = |slot: &usize| (dot(*w, self.survey.direction(point, chosen[*slot])), *slot);
            let mut all: Vec<(f32, usize)> = seers.iter().map(near).collect();
            all.sort_by(|a, b| b.0.total_cmp(&a.0));
            let angle = |rank: usize| all.get(rank).map_or(PI, |(cos, _)| angle(*cos));
            let bar = all.get(1).map_or(-2.0, |(cos, _)| *cos);
            Client { first: angle(0), second: angle(1), bar, slot: all.first().map(|(_, slot)| *slot) }
        };
        self.directions[point].iter().map(client).collect()
    }

    fn cost(&self, chosen: &[usize]) -> f64 {
        let cost = |point: usize| {
            let sum: f64 = self.clients(point, chosen).iter().map(|client| f64::from(client.first)).sum();
            let lacking = 3usize.saturating_sub(self.seers(point, chosen).len());
            self.weight[point] * sum + self.lack[point] * lacking as f64
        };
        let prices: f64 = chosen.iter().map(|photo| self.price[*photo]).sum();
        (0..self.directions.len()).map(cost).sum::<f64>() + prices
    }

    fn losses(&self, chosen: &[usize]) -> Vec<f64> {
        let mut losses: Vec<f64> = chosen.iter().map(|photo| -self.price[*photo]).collect();
        for point in 0..self.directions.len() {
            for client in self.clients(point, chosen) {
                if let Some(slot) = client.slot {
                    losses[slot] += self.weight[point] * f64::from(client.second - client.first);
                }
            }
            let seers = self.seers(point, chosen);
            if seers.len() <= 3 {
                seers.iter().for_each(|slot| losses[*slot] += self.lack[point]);
            }
        }
        losses
    }

    /// The fall of the cost if a photo were added, and by slot what it would spare.
    fn gain(&self, chosen: &[usize], photo: usize) -> (f64, Vec<f64>) {
        let (mut gain, mut spared) = (-self.price[photo], vec![0.0; chosen.len()]);
        for point in (0..self.directions.len()).filter(|point| self.survey.sight.sees(*point, photo)) {
            let seers = self.seers(point, chosen);
            match seers.len() {
                0..3 => gain += self.lack[point],
                3 => seers.iter().for_each(|slot| spared[*slot] += self.lack[point]),
                _ => {}
            }
            let n = self.survey.direction(point, photo);
            for (w, client) in self.directions[point].iter().zip(self.clients(point, chosen)) {
                let cos = dot(*w, n);
                if cos <= client.bar {
                    continue;
                }
                let own = angle(cos);
                if own < client.first {
                    gain += self.weight[point] * f64::from(client.first - own);
                }
                let still = client.second - own.max(client.first);
                if let (Some(slot), true) = (client.slot, still > 0.0) {
                    spared[slot] += self.weight[point] * f64::from(still);
                }
            }
        }
        (gain, spared)
    }

    /// The change of the best swap that brings a photo in, and its slot.
    fn best_swap(&self, chosen: &[usize], losses: &[f64], photo: usize, fixed: &[bool]) -> (f64, usize) {
        let (gain, spared) = self.gain(chosen, photo);
        let mut best = (f64::INFINITY, 0);
        for slot in (0..chosen.len()).filter(|slot| !fixed[*slot]) {
            let change = losses[slot] - spared[slot] - gain;
            if change < best.0 {
                best = (change, slot);
            }
        }
        best
    }

    /// One candidate after the other.
    fn refine(&self, chosen: &mut [usize], fixed: &[bool]) -> Vec<f64> {
        let mut costs = vec![self.cost(chosen)];
        loop {
            let outside: Vec<usize> = (0..self.price.len()).filter(|photo| !chosen.contains(photo)).collect();
            let (mut cost, mut losses) = (costs[costs.len() - 1], self.losses(chosen));
            let swap = |photo: usize| (self.best_swap(chosen, &losses, photo, fixed), photo);
            let mut promised: Vec<_> = outside.into_iter().map(swap).filter(|(s, _)| s.0 < -1e-7 * cost).collect();
            promised.sort_by(|a, b| a.0.0.total_cmp(&b.0.0).then(a.1.cmp(&b.1)));
            if promised.is_empty() {
                return costs;
            }
            for (rank, (promise, photo)) in promised.into_iter().enumerate() {
                let (change, slot) = self.best_swap(chosen, &losses, photo, fixed);
                if rank == 0 || change <= 0.5 * promise.0 && change < -1e-7 * cost {
                    chosen[slot] = photo;
                    (cost, losses) = (self.cost(chosen), self.losses(chosen));
                    costs.push(cost);
                }
            }
        }
    }

    /// Every candidate looked at every time.
    fn grow(&self, chosen: &mut Vec<usize>, count: usize) {
        while chosen.len() < count {
            let free = (0..self.price.len()).filter(|photo| !chosen.contains(photo));
            let best =
                free.map(|photo| (self.gain(chosen, photo).0, photo)).reduce(|a, b| if b.0 > a.0 { b } else { a });
            chosen.extend(best.map(|(_, photo)| photo));
        }
    }
}

/// Swaps are found from numbers that are kept, packed and shared among threads. Were one of them off by a bit, a choice could
/// change with a version that only claims to be faster.
#[test]
fn kept_numbers_are_those_of_a_plain_reference_to_the_bit() {
    for (seed, resolution) in [(0, 16), (1, 20), (2, 16)] {
        let survey = survey(seed, 150, 90);
        let price: Vec<f64> = (0..90).map(|i| 1e-3 * f64::from(i % 4)).collect();
        let reference = Reference::new(&survey, resolution, price.clone());
        let counts = || reference.directions.iter().map(Vec::len);
        assert!(counts().any(|count| count == 0) && counts().any(|count| count > 128), "this tests too little");
        let objective = Objective::new(&survey, resolution).with_prices(price);
        let mut chosen = vec![7, 1, 40, 2, 55, 0, 23, 89];
        let mut choice = objective.choose(&chosen);
        for (slot, photo) in [(3, 60), (0, 2), (7, 13), (5, 88)] {
            assert_eq!(choice.cost().to_bits(), reference.cost(&chosen).to_bits());
            let losses = reference.losses(&chosen);
            assert_eq!(choice.losses(), losses);
            let mut spared = [0.0; 8];
            for photo in (0..90).filter(|photo| !chosen.contains(photo)) {
                let (gain, expected) = reference.gain(&chosen, photo);
                assert_eq!((choice.gain(photo, &mut spared), &spared[..]), (gain, &expected[..]), "photo {photo}");
                let swap = choice.best_swap(photo, &[false; 8], &mut spared);
                assert_eq!((swap.change, swap.slot), reference.best_swap(&chosen, &losses, photo, &[false; 8]));
            }
            choice.replace(slot, photo);
            chosen[slot] = photo;
        }
    }
}

/// The whole search must end with the photos, and go through the costs, of one that looks at a candidate at a time and keeps
/// nothing: else what makes it fast has made it another search.
#[test]
fn the_search_is_that_of_a_plain_reference_to_the_bit() {
    for (seed, resolution) in [(3, 16), (4, 12), (5, 16)] {
        let survey = survey(seed, 150, 90);
        let mut reference = Reference::new(&survey, resolution, vec![0.0; 90]);
        let mut objective = Objective::new(&survey, resolution);
        let everything: Vec<usize> = (0..90).collect();
        let fixed: Vec<bool> = (0..10).map(|slot| slot < 2).collect();

        let mut expected = vec![4, 9];
        reference.grow(&mut expected, 10);
        let mut choice = objective.choose(&[4, 9]);
        grow(&mut choice, &everything, 10);
        assert_eq!(choice.chosen(), expected, "greedy");

        let mut chosen: Vec<usize> = (0..10).collect();
        let mut expected = chosen.clone();
        for round in 0..3 {
            let costs = reference.refine(&mut expected, &fixed);
            assert!(round > 0 || costs.len() > 5, "hardly a swap: this tests little");
            let mut choice = objective.choose(&chosen);
            assert_eq!(refine(&mut choice, &everything, &fixed), costs, "round {round}");
            assert_eq!(choice.chosen(), expected, "round {round}");
            chosen = expected.clone();
            objective.raise_shortage();
            reference.lack.iter_mut().for_each(|lack| *lack *= 1.5);
        }
    }
}
