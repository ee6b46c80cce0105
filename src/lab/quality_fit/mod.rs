//! The fit of the law: least squares of the trained PSNR of layouts on the expected one, within each test view of a scene and situation,
//! whatever the layouts' numbers of views.
//!
//! A layout's expected quality is the mean over test views of `-10 log10` of the mean of `w / (exp(-z) + exp(-m))` over the pixels of a
//! grid, with `z = b1 g1 + b3 g3 + c max(ln r, 0)`, as [`law`](crate::planner::quality::law) has it. What is fitted is `b1`, `b3`, `c`, the
//! weight `w` of pixels beside an object, and the end `m`; the scale needs no factor of its own, since it is that of the others. What all
//! layouts share in a test view, such as material and light, cancels. The third nearest view and the end are in the law only where each lowers
//! the sum of squares by a fiftieth.

mod observation;
mod solver;
mod spread;

use serde::Serialize;

pub use observation::{Layout, Observations};
use solver::{BESIDE, FARTHER, MOST, N, THIRD};
use spread::Spread;

use crate::planner::quality::law::{Coefficients, FARTHEST, Fitted, NO_END};
use crate::{Error, Result};

/// Fewest layouts of a scene that can be compared.
const MIN_LAYOUTS: usize = 3;
/// Where the search begins.
const START: [f64; N] = [1.0, 0.5, 0.5, -3.0, 6.0];
/// Where it begins once more in a law with an end: from too far an end it may run on to none.
const NEAR_END: f64 = 3.0;
/// How far beyond what errors rise by angle an end is none: it takes a twentieth of them at most.
const BEYOND: f64 = 3.0;
/// By how much the sum of squares must fall for what is added to the law: by a fiftieth.
const EARNS: f64 = 1.02;

/// A law with what it was fitted to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fit {
    /// The law.
    pub law: Fitted,
    /// How well it predicts the scenes it was fitted to.
    pub fitted: Agreement,
    /// How well it predicts the others.
    pub held_out: Option<Agreement>,
    /// Pairs of layouts of as many views with one lens that are expected to be alike.
    pub alike_pairs: usize,
}

impl Fit {
    /// Expected quality of each of a scene's layouts on its test views, in decibels up to the scene's own level.
    pub fn expected(&self, scene: &Observations) -> Vec<f64> {
        let Coefficients { nearest, third, farther, background, most } = self.law.coefficients;
        // A room has no pixels beside it.
        let log_weight = if background > 0.0 { background.ln() } else { 0.0 };
        solver::expected(scene, &[nearest, third, farther, log_weight, most.unwrap_or(NO_END)])
    }
}

/// How expected and trained quality agree within scenes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// Layouts of each scene and situation, of all numbers of views together.
    pub whole: Correlation,
    /// Of each scene, situation, number of views and lens; none where there are never enough of them.
    pub of_budgets: Option<Correlation>,
}

/// How two quantities go together in groups of layouts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Correlation {
    /// Groups of layouts.
    pub groups: usize,
    /// Layouts in all.
    pub layouts: usize,
    /// Pearson's correlation in the mean over groups.
    pub pearson: f64,
    /// The least of them.
    pub least: f64,
    /// Trained decibels for an expected one, the mean over groups.
    pub slope: f64,
}

/// A layout's expected and trained quality, in decibels.
type Pair = (f64, f64);

/// Fits the law to all `scenes` except those named in `held_out`, which it is only compared with.
///
/// # Errors
/// Where no scene is left with layouts enough, or the layouts do not determine the coefficients.
pub fn fit(scenes: &[Observations], held_out: &[String]) -> Result<Fit> {
    let (held, fitted): (Vec<_>, Vec<_>) = scenes.iter().partition(|scene| held_out.contains(&scene.name));
    let too_few = || {
        Error::request(format!(
            "the fit needs {MIN_LAYOUTS} layouts or more of one scene, and others that differ; train more layouts"
        ))
    };
    if let Some(scene) = scenes.iter().find(|scene| scene.ends.is_empty()) {
        return Err(Error::request(format!(
            "no test view of {} shows enough of its surface; leave it out",
            scene.name
        )));
    }
    let object = scenes.iter().any(|scene| scene.beside.contains(&true));
    if let Some(room) = scenes.iter().find(|scene| object && !scene.beside.contains(&true)) {
        let what =
            format!("{} has no empty place beside it, and others have: a law is of objects, or of rooms", room.name);
        return Err(Error::request(format!("{what}; fit each by itself")));
    }
    let (best, free) = least_squares(&fitted, object).ok_or_else(too_few)?;
    let names = |scenes: &[&Observations]| -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for scene in scenes {
            if !names.contains(&scene.name) {
                names.push(scene.name.clone());
            }
        }
        names
    };
    // Jackknife over scenes: what is seen of one scene's layouts, in whatever situation, is not independent.
    let own_names = names(&fitted);
    let without: Vec<[f64; N]> = own_names
        .iter()
        .filter(|_| own_names.len() > 2)
        .filter_map(|left| {
            // Of the same form, which is chosen once; of another only where the rest does not determine this one.
            let others: Vec<_> = fitted.iter().filter(|scene| scene.name != *left).copied().collect();
            let same = solved(&others, &free).map(|(theta, _)| theta);
            same.or_else(|| least_squares(&others, object).map(|(theta, _)| theta))
        })
        .collect();
    let deviation = (without.len() == own_names.len() && own_names.len() > 2).then(|| {
        let n = without.len() as f64;
        std::array::from_fn(|k| {
            let mean = without.iter().map(|theta| theta[k]).sum::<f64>() / n;
            // Zero of what is not fitted.
            ((n - 1.0) / n * without.iter().map(|theta| (theta[k] - mean).powi(2)).sum::<f64>()).sqrt()
        })
    });
    let pairs = |scenes: &[&Observations], of_budgets: bool| -> Vec<Vec<Pair>> {
        let of = |scene: &&Observations| {
            let expected = solver::expected(scene, &best);
            let groups = if of_budgets { scene.groups() } else { vec![(0..scene.layouts.len()).collect()] };
            let pair = |i: usize| (expected[i], scene.layouts[i].trained());
            groups.into_iter().map(|group| group.into_iter().map(pair).collect::<Vec<Pair>>()).collect::<Vec<_>>()
        };
        scenes.iter().flat_map(of).filter(|group| group.len() >= MIN_LAYOUTS).collect()
    };
    let agreement = |scenes: &[&Observations]| -> Option<Agreement> {
        let whole = correlation(&pairs(scenes, false))?;
        Some(Agreement { whole, of_budgets: correlation(&pairs(scenes, true)) })
    };
    // A law predicts too well what it was fitted to: each scene by the law of the others.
    let by_others = fitted.iter().filter_map(|scene| {
        let left = own_names.iter().position(|name| *name == scene.name)?;
        deviation.is_some().then(|| (*scene, without[left]))
    });
    let mut others: Vec<_> = by_others.chain(held.iter().map(|scene| (*scene, best))).collect();
    if others.is_empty() {
        others.extend(fitted.iter().map(|scene| (*scene, best)));
    }
    let Spread { alike, borrowed, per_decibel, alike_pairs } = spread::of(&others, object);
    let law = Fitted {
        coefficients: Coefficients {
            nearest: best[0],
            third: best[THIRD],
            farther: best[FARTHER],
            most: free[MOST].then_some(best[MOST]),
            background: if free[BESIDE] { best[BESIDE].exp() } else { 0.0 },
        },
        spread: [alike, per_decibel],
        borrowed,
        deviation,
        scenes: own_names,
        held_out: names(&held),
        layouts: fitted.iter().map(|scene| scene.layouts.len()).sum(),
    };
    law.coefficients.check().map_err(|error| Error::request(format!("{error}; train layouts that differ more")))?;
    if object && law.coefficients.background < 1e-6 {
        return Err(Error::request(
            "the weight beside objects vanishes, without which they would be taken for rooms; train layouts that differ more",
        ));
    }
    Ok(Fit { law, fitted: agreement(&fitted).ok_or_else(too_few)?, held_out: agreement(&held), alike_pairs })
}

/// The best parameters, and which of them are fitted: with the third nearest view and an end where these earn their places.
fn least_squares(scenes: &[&Observations], object: bool) -> Option<([f64; N], [bool; N])> {
    let of_form = |third: bool, most: bool| {
        let free: [bool; N] = std::array::from_fn(|k| match k {
            THIRD => third,
            MOST => most,
            BESIDE => object,
            _ => true,
        });
        let (theta, cost) = solved(scenes, &free)?;
        let ends = theta[MOST] < FARTHEST * (theta[0] + theta[THIRD]) + BEYOND;
        let fits = theta[THIRD] >= 0.0 && (!most || ends);
        let more = i32::from(third) + i32::from(most);
        fits.then_some((cost * EARNS.powi(more), theta, free))
    };
    let all = [(false, false), (false, true), (true, false), (true, true)];
    let found = all.into_iter().filter_map(|(third, most)| of_form(third, most));
    found.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, theta, free)| (theta, free))
}

/// The parameters of least squares where these are `free`, and the sum of squares; none of too few layouts.
fn solved(scenes: &[&Observations], free: &[bool; N]) -> Option<([f64; N], f64)> {
    let mut start = START;
    for (k, without) in [(THIRD, 0.0), (BESIDE, 0.0), (MOST, NO_END)] {
        if !free[k] {
            start[k] = without;
        }
    }
    // Each scene has levels of its own.
    let differences =
        scenes.iter().filter(|scene| scene.layouts.len() >= MIN_LAYOUTS).map(|scene| scene.layouts.len() - 1);
    if differences.sum::<usize>() <= free.iter().filter(|free| **free).count() {
        return None;
    }
    let near = free[MOST].then(|| {
        let mut near = start;
        near[MOST] = NEAR_END;
        near
    });
    let found = [Some(start), near].into_iter().flatten().filter_map(|start| solver::solve(scenes, start, free));
    found.min_by(|a, b| a.1.total_cmp(&b.1))
}

fn correlation(groups: &[Vec<Pair>]) -> Option<Correlation> {
    let found: Vec<[f64; 2]> = groups.iter().map(|group| of_group(group)).collect();
    let mean = |k: usize| found.iter().map(|one| one[k]).sum::<f64>() / found.len() as f64;
    (!found.is_empty()).then(|| Correlation {
        groups: groups.len(),
        layouts: groups.iter().map(Vec::len).sum(),
        pearson: mean(0),
        least: found.iter().map(|one| one[0]).fold(1.0, f64::min),
        slope: mean(1),
    })
}

/// Pearson's correlation and the slope of the second on the first.
fn of_group(pairs: &[Pair]) -> [f64; 2] {
    let n = pairs.len() as f64;
    let (mx, my) = (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
    let sum = |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(x, y)| of(x - mx, y - my)).sum::<f64>();
    let (xx, yy, xy) = (sum(&|x, _| x * x), sum(&|_, y| y * y), sum(&|x, y| x * y));
    [xy / (xx * yy).sqrt().max(f64::MIN_POSITIVE), xy / xx.max(f64::MIN_POSITIVE)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::random;

    /// Trains the layouts by the law `theta`, with `more` of each. Each test view has a level of its own.
    fn train(scene: &mut Observations, theta: &[f64; N], more: impl Fn(u32) -> f64) {
        let views: Vec<_> = scene.layouts.iter().map(|layout| solver::predict(scene, layout, theta)).collect();
        for (l, (layout, views)) in (0..).zip(scene.layouts.iter_mut().zip(views)) {
            layout.psnr = (0..).zip(views).map(|(view, (db, _))| 25.0 + 2.0 * f64::from(view) + db + more(l)).collect();
        }
    }

    /// Layouts whose looks have these angles and footprints at random, trained by the law `theta`, with noise of `noise` dB.
    fn scene(name: &str, theta: [f64; N], noise: f64, seed: u64) -> Observations {
        let (views, looks) = (6, 40);
        let beside: Vec<bool> = (0..views * looks).map(|i| i % 4 == 3).collect();
        let ends = (1..=views).map(|view| view * looks).collect();
        let layout = |l: u32| {
            let size = 0.2 + random::uniforms(seed, 9, l)[0];
            let near = (0..(views * looks) as u32).map(|i| {
                let [a, b, c, _] = random::uniforms(seed, l, i);
                let g1 = size * a;
                [g1, (g1 + size * b).min(2.0), (c * 2.0 * random::uniforms(seed, 8, l)[1] - 0.4).max(0.0)]
                    .map(|x| x as f32)
            });
            Layout {
                name: format!("{l}"),
                views: 10 + 10 * (l % 2),
                degrees: 50,
                psnr: Vec::new(),
                near: near.collect(),
            }
        };
        let mut scene = Observations {
            name: name.into(),
            beside,
            shown: (0..views).collect(),
            ends,
            layouts: (0..16).map(layout).collect(),
        };
        train(&mut scene, &theta, |l| {
            let [u, v, ..] = random::uniforms(seed, 7, l);
            (seed % 7) as f64 + noise * 12f64.sqrt() * (0.5 * (u + v) - 0.5) * 2f64.sqrt()
        });
        scene
    }

    /// If this failed, the published coefficients would be those of something else than the law that plans descend.
    #[test]
    fn a_law_is_found_again_from_layouts_that_follow_it() {
        let theta = [1.3, 0.6, 0.8, -2.8, 2.0];
        let scenes: Vec<_> = (0..5).map(|i| scene(&format!("s{i}"), theta, 0.0, 40 + i)).collect();
        let found = fit(&scenes, &["s4".into()]).unwrap();
        let Coefficients { nearest, third, farther, background, most } = found.law.coefficients;
        for (value, wanted) in [nearest, third, farther, background.ln(), most.unwrap()].into_iter().zip(theta) {
            assert!((value - wanted).abs() < 1e-6, "{:?}", found.law);
        }
        let held_out = found.held_out.unwrap();
        assert!(held_out.whole.pearson > 1.0 - 1e-9 && held_out.of_budgets.unwrap().groups == 2);
        assert_eq!((found.law.scenes.len(), found.law.held_out), (4, vec!["s4".to_string()]));
        // With noise it is found within the jackknife's deviations.
        let noisy: Vec<_> = (0..5).map(|i| scene(&format!("s{i}"), theta, 0.05, 80 + i)).collect();
        let found = fit(&noisy, &[]).unwrap();
        let deviation = found.law.deviation.unwrap();
        for ((value, wanted), sd) in
            [found.law.coefficients.nearest, found.law.coefficients.third].into_iter().zip(theta).zip(deviation)
        {
            assert!((value - wanted).abs() < 4.0 * sd && sd < 0.5, "{value} is not {wanted} within {sd}");
        }
        assert!((found.law.spread[0] - 0.05 * 2f64.sqrt()).abs() < 0.02, "{:?}", found.law.spread);
        assert_eq!(fit(&noisy, &[]).unwrap(), found);
    }

    /// If this failed, rooms would have no law of their own, or one whose error falls where a third view is farther away.
    #[test]
    fn what_does_not_earn_its_place_is_left_out() {
        let room = |name: &str, theta, seed| {
            let mut room = scene(name, theta, 0.0, seed);
            room.beside.iter_mut().for_each(|beside| *beside = false);
            train(&mut room, &theta, |_| 0.0);
            room
        };
        let rooms = |theta| [room("a", theta, 50), room("b", theta, 51), room("c", theta, 52)];
        // Errors that fall by the third view cannot be of a law; those that never end have none.
        let found = fit(&rooms([1.5, -0.2, 0.6, 0.0, 2.0]), &[]).unwrap().law;
        assert!(
            found.coefficients.third == 0.0 && found.coefficients.background == 0.0 && found.coefficients.nearest > 1.0,
            "{found:?}"
        );
        assert!((found.coefficients.most.unwrap() - 2.0).abs() < 0.3, "{found:?}");
        let found = fit(&rooms([1.5, 0.4, 0.6, 0.0, NO_END]), &[]).unwrap().law;
        assert!(found.coefficients.most.is_none() && (found.coefficients.third - 0.4).abs() < 1e-6, "{found:?}");
        assert_eq!(found.deviation.unwrap()[3..], [0.0; 2]);
        // One law is of rooms, or of objects.
        let both = [room("a", START, 50), scene("b", START, 0.0, 51)];
        let refused = fit(&both, &[]).unwrap_err().to_string();
        assert!(refused.contains("of objects, or of rooms"), "{refused}");
    }

    /// If this failed, a scene that was trained in two situations would be left out twice, one half at a time, and the deviations be
    /// too small.
    #[test]
    fn parts_of_a_scene_are_left_out_together() {
        // Each scene follows a law of its own.
        let part = |name: &str, nearest: f64, seed| scene(name, [nearest, 0.6, 0.8, -2.8, 2.0], 0.0, seed);
        let parts =
            [part("a", 1.3, 40), part("b", 1.1, 41), part("c", 1.5, 42), part("a", 1.3, 43), part("d", 1.3, 44)];
        let found = fit(&parts, &["d".into()]).unwrap();
        assert_eq!(
            (found.law.scenes, found.law.held_out),
            (vec!["a".into(), "b".into(), "c".into()], vec!["d".into()])
        );
        let alone = |left: &str| -> f64 {
            let others: Vec<_> = parts[..4].iter().filter(|part| part.name != left).collect();
            least_squares(&others, true).unwrap().0[0]
        };
        let each = ["a", "b", "c"].map(alone);
        let mean = each.iter().sum::<f64>() / 3.0;
        let expected = (2.0 / 3.0 * each.iter().map(|one| (one - mean).powi(2)).sum::<f64>()).sqrt();
        let deviation = found.law.deviation.unwrap()[0];
        assert!((deviation / expected - 1.0).abs() < 1e-9, "{deviation} in place of {expected}");
    }

    /// If this failed, intervals would be of scenes that the law was fitted to, or hold lenses against each other.
    #[test]
    fn the_spread_is_of_other_scenes_and_of_one_lens() {
        // Each scene follows a law of its own, which that of the others misses by as much as they differ.
        let of = |name: &str, nearest: f64, seed| scene(name, [nearest, 0.6, 0.8, -2.8, 2.0], 0.0, seed);
        let scenes = [of("a", 1.3, 40), of("b", 1.1, 41), of("c", 1.5, 42)];
        let law_without = |left: usize| {
            let others: Vec<_> =
                scenes.iter().enumerate().filter(|(i, _)| *i != left).map(|(_, scene)| scene).collect();
            least_squares(&others, true).unwrap().0
        };
        let expected = spread::of(&[0, 1, 2].map(|i| (&scenes[i], law_without(i))), true);
        let found = fit(&scenes, &[]).unwrap();
        assert!(expected.per_decibel > 0.01 && !expected.borrowed && !found.law.borrowed, "{expected:?}");
        assert_eq!(found.alike_pairs, expected.alike_pairs);
        for (one, other) in found.law.spread.into_iter().zip([expected.alike, expected.per_decibel]) {
            assert!((one - other).abs() < 1e-9, "{:?} in place of {expected:?}", found.law.spread);
        }
        // Of two scenes neither has a law of others; one that is held out has.
        let two = fit(&scenes, &["c".into()]).unwrap().law;
        let of_others = least_squares(&[&scenes[0], &scenes[1]], true).unwrap().0;
        let expected = spread::of(&[(&scenes[2], of_others)], true);
        assert_eq!(two.spread, [expected.alike, expected.per_decibel]);
    }

    /// If this failed, a fit without layouts that are alike, or with one lucky pair of them, would say that such differ by nothing, and plans
    /// be taken for better than simple layouts for any lead.
    #[test]
    fn what_layouts_that_are_alike_differ_by_is_of_ten_pairs_or_the_built_in_law_s() {
        // Five layouts that are expected to be alike, of which two trained 3 dB more than the others.
        let mut alike = scene("a", START, 0.0, 43);
        alike.layouts.truncate(1);
        alike.layouts[0].psnr = vec![25.0; 6];
        for psnr in [25.0, 25.0, 28.0, 28.0] {
            alike.layouts.push(Layout { psnr: vec![psnr; 6], ..alike.layouts[0].clone() });
        }
        let of = |alike: &Observations, object: bool| spread::of(&[(alike, START)], object);
        let Spread { alike: sd, borrowed, alike_pairs, .. } = of(&alike, true);
        assert!((sd - (0.6 * 9f64).sqrt()).abs() < 1e-12 && !borrowed && alike_pairs == 10, "{sd}");
        alike.layouts[1].degrees = 80;
        for object in [true, false] {
            let built_in = Fitted::embedded(object).spread[0];
            assert_eq!(
                of(&alike, object),
                Spread { alike: built_in, borrowed: true, per_decibel: 0.0, alike_pairs: 6 }
            );
        }
        // Of a whole fit, each of whose layouts has a number of views of its own.
        let mut scenes = ["a", "b", "c"].map(|name| scene(name, [1.3, 0.6, 0.8, -2.8, 2.0], 2.0, 40));
        scenes.iter_mut().for_each(|scene| (1..).zip(&mut scene.layouts).for_each(|(l, layout)| layout.views = l));
        let found = fit(&scenes, &[]).unwrap();
        let built_in = Fitted::embedded(true).spread[0];
        assert!(found.law.borrowed && found.alike_pairs == 0 && found.law.spread[0] == built_in, "{found:?}");
        // The scenes are the same, so that each is by its own law, and what is left beyond the built-in figure is by the decibel.
        let (expected, trained) = (found.expected(&scenes[0]), scenes[0].layouts.iter().map(Layout::trained));
        let layouts: Vec<Pair> = expected.into_iter().zip(trained).collect();
        let pairs =
            layouts.iter().enumerate().flat_map(|(i, a)| layouts[..i].iter().map(move |b| (a.0 - b.0, a.1 - b.1)));
        let far: Vec<Pair> = pairs.filter(|(x, _)| x.abs() >= 1.0).collect();
        let squares = far.iter().map(|(x, y)| ((y - x).powi(2) - built_in.powi(2)) / (x * x)).sum::<f64>();
        let wanted = (squares / far.len() as f64).sqrt();
        assert!(wanted > 0.0 && (found.law.spread[1] - wanted).abs() < 1e-6, "{:?}, {wanted}", found.law.spread);
    }

    /// If this failed, the end would be none where the search runs away from it, and with it the other coefficients be of another law.
    #[test]
    fn the_end_is_found_from_a_second_start() {
        let theta = [3.0, 0.6, 0.8, -2.8, 3.0];
        let scenes = [scene("a", theta, 0.0, 40), scene("b", theta, 0.0, 50)];
        let of_scenes: Vec<_> = scenes.iter().collect();
        let (away, _) = solver::solve(&of_scenes, START, &[true; N]).unwrap();
        assert!(away[MOST] > 20.0, "the first start finds it alone: {away:?}");
        let most = fit(&scenes, &[]).unwrap().law.coefficients.most;
        assert!(most.is_some_and(|most| (most - theta[MOST]).abs() < 1e-6), "{most:?}");
    }

    /// If this failed, deviations would be of laws of several forms, and those of what only one scene shows be as large as its coefficient.
    #[test]
    fn what_is_left_out_changes_no_form() {
        // The third view counts in one scene only.
        let of = |name: &str, third: f64, seed| scene(name, [1.3, third, 0.8, -2.8, 2.0], 0.05, seed);
        let scenes = [of("a", 0.0, 40), of("b", 0.0, 41), of("c", 1.2, 42)];
        let (_, free) = least_squares(&scenes.iter().collect::<Vec<_>>(), true).unwrap();
        let others = |left: usize| -> Vec<&Observations> {
            scenes.iter().enumerate().filter(|(i, _)| *i != left).map(|(_, scene)| scene).collect()
        };
        let of_others = least_squares(&others(2), true).unwrap().1;
        assert!(free[THIRD] && !of_others[THIRD], "the form is the same with and without the scene: {free:?}");
        let each = [0, 1, 2].map(|left| solved(&others(left), &free).unwrap().0[THIRD]);
        let mean = each.iter().sum::<f64>() / 3.0;
        let expected = (2.0 / 3.0 * each.iter().map(|one| (one - mean).powi(2)).sum::<f64>()).sqrt();
        let deviation = fit(&scenes, &[]).unwrap().law.deviation.unwrap()[THIRD];
        assert!((deviation / expected - 1.0).abs() < 1e-9, "{deviation} in place of {expected}");
    }

    /// If this failed, a fit to next to nothing would be taken for a law.
    #[test]
    fn too_few_layouts_are_refused() {
        let mut few = scene("few", START, 0.1, 3);
        few.layouts.truncate(4);
        let refused = fit(&[few], &[]).unwrap_err().to_string();
        assert!(refused.contains("train more layouts"), "{refused}");
    }
}
