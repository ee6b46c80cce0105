//! Means over scenes, and what methods differ by on the same scenes.

use serde::Serialize;

use super::competitor::Competitor;
use super::results::{Interval, METRICS, Row, interval};
use crate::planner::methods::Method;

/// A method at a budget on all scenes that every method has at this budget. Intervals are over scenes, of each of which the mean over its
/// seeds counts: runs of one scene are more alike than scenes are.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneMean {
    /// The method that chose the views.
    pub method: Competitor,
    /// How many.
    pub views: u32,
    /// Scenes that the mean is over, two or more.
    pub scenes: usize,
    /// The method that differences are from.
    pub reference: Competitor,
    /// Of each of [`METRICS`] the mean, over the sets of tests too, and the mean difference from the reference on the same scene; none
    /// where it was not measured, and of the reference itself.
    pub measured: [[Option<Interval>; 2]; METRICS.len()],
}

impl SceneMean {
    /// Mean and difference of a metric as tables show them: the interval of the mean, which is how unlike scenes are, is left out.
    pub fn shown(&self, metric: usize) -> [Option<Interval>; 2] {
        let [mean, difference] = self.measured[metric];
        [mean.map(|mean| Interval { half: None, ..mean }), difference]
    }
}

/// The means of all methods and budgets, in the order of the rows; none of a budget of which fewer than two scenes have all methods. The
/// reference is the planner, or where it is not compared the first method that all budgets have; without one there are no means.
pub fn means_over_scenes(rows: &[Row]) -> Vec<SceneMean> {
    let at_all = |method: &Competitor| {
        rows.iter().all(|row| rows.iter().any(|other| other.views == row.views && other.method == *method))
    };
    let ours = Competitor::Method(Method::Ours);
    let others = rows.iter().map(|row| &row.method);
    let Some(reference) = std::iter::once(&ours).chain(others).find(|method| at_all(method)) else {
        return Vec::new();
    };
    let mut means: Vec<SceneMean> = Vec::new();
    for row in rows {
        if means.iter().any(|mean| mean.method == row.method && mean.views == row.views) {
            continue;
        }
        let at = |scene: &str, method: &Competitor| {
            rows.iter().find(|other| other.scene == scene && other.method == *method && other.views == row.views)
        };
        let mut methods: Vec<&Competitor> = Vec::new();
        let mut scenes: Vec<&str> = Vec::new();
        for other in rows.iter().filter(|other| other.views == row.views) {
            if !methods.contains(&&other.method) {
                methods.push(&other.method);
            }
            if !scenes.contains(&other.scene.as_str()) {
                scenes.push(&other.scene);
            }
        }
        scenes.retain(|scene| methods.iter().all(|method| at(scene, method).is_some()));
        if scenes.len() < 2 {
            continue;
        }
        // The last column is the mean over the sets, or the only set.
        let value = |scene: &str, method: &Competitor, metric: usize| {
            at(scene, method).and_then(|row| row.measured[metric].last().copied().flatten()).map(|of| of.mean)
        };
        let over = |of: &dyn Fn(&str) -> Option<f64>| {
            scenes.iter().map(|scene| of(scene)).collect::<Option<Vec<f64>>>().map(|values| interval(&values))
        };
        let measured = std::array::from_fn(|metric| {
            let mean = over(&|scene| value(scene, &row.method, metric));
            let difference = over(&|scene| Some(value(scene, &row.method, metric)? - value(scene, reference, metric)?));
            [mean, difference.filter(|_| row.method != *reference)]
        });
        let (method, reference) = (row.method.clone(), reference.clone());
        means.push(SceneMean { method, views: row.views, scenes: scenes.len(), reference, measured });
    }
    means
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, methods would be compared on different scenes, or the interval would be that of scenes and not of differences.
    /// Differences of 1, 2 and 3 dB: mean 2, deviation 1, though the scenes are 10 dB apart.
    #[test]
    fn methods_are_compared_on_the_same_scenes() {
        let row = |scene: &str, method, psnr: f64| Row {
            scene: scene.into(),
            method: Competitor::Method(method),
            views: 20,
            seeds: 3,
            diverged: 0,
            seconds: None,
            outside: 0,
            measured: [
                vec![None, Some(Interval { mean: psnr, half: Some(9.0) })],
                vec![None; 2],
                vec![None; 2],
                vec![None; 2],
            ],
        };
        let mut rows = Vec::new();
        for (scene, psnr, more) in [("a", 10.0, 1.0), ("b", 20.0, 2.0), ("c", 30.0, 3.0)] {
            rows.extend([row(scene, Method::Random, psnr - more), row(scene, Method::Ours, psnr)]);
        }
        // A scene that one method lacks counts for none.
        rows.push(row("d", Method::Ours, 90.0));
        let means = means_over_scenes(&rows);
        let [random, ours] = &means[..] else { panic!("{means:?}") };
        assert_eq!((random.scenes, &random.reference), (3, &Competitor::Method(Method::Ours)));
        let [Some(mean), Some(difference)] = random.measured[0] else { panic!("{random:?}") };
        assert!((mean.mean - 18.0).abs() < 1e-12 && (difference.mean + 2.0).abs() < 1e-12);
        assert!((difference.half.unwrap() - 4.303 / 3f64.sqrt()).abs() < 1e-9 && mean.half.unwrap() > 20.0);
        assert_eq!((ours.measured[0][1], ours.measured[1]), (None, [None; 2]));
        assert!(means_over_scenes(&rows[..2]).is_empty(), "one scene has no mean over scenes");
        // Differences are from a method that all budgets have.
        let more = ["a", "b"].map(|scene| Row { views: 50, ..row(scene, Method::Random, 40.0) });
        rows.extend(more);
        assert!(means_over_scenes(&rows).iter().all(|mean| mean.reference == Competitor::Method(Method::Random)));
    }
}
