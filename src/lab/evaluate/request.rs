//! What is compared, and how.

use std::fmt;
use std::sync::Arc;

use serde::Serialize;

use super::competitor::Competitor;
use super::given::left_out;
use super::kind::Kind;
use super::settings::{BY_BOUNDS, BaselinesFrom, EvaluationSettings, InputsFrom, Shown, Space};
use super::situation::Situation;
use crate::planner::methods::Method;
use crate::planner::quality::viewers::Viewers;
use crate::scene::limits::Limits;
use crate::{Error, Result};

/// The set of test views at positions from the user.
const GIVEN_VIEWERS: &str = "viewers";
/// A method that gets a number of views once.
#[derive(Clone, Copy, Debug)]
pub struct Run<'r> {
    /// Its number among the runs of a subject.
    pub number: usize,
    /// Who chooses.
    pub method: &'r Competitor,
    /// How many views.
    pub views: u32,
    /// Seed of the choice and of the training.
    pub seed: u64,
}

impl fmt::Display for Run<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { method, views, seed, .. } = self;
        write!(f, "{method}, {views} views, seed {seed}")
    }
}

/// The request of an evaluation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EvaluationRequest {
    /// The kind of all subjects.
    pub kind: Kind,
    /// Methods, each once.
    pub methods: Vec<Competitor>,
    /// Numbers of views, each once.
    pub budgets: Vec<u32>,
    /// Runs of each.
    pub seeds: u32,
    /// The seed of the first of these; the others follow.
    pub first_seed: u32,
    /// The size of everything.
    pub settings: EvaluationSettings,
    /// Where viewers look from: where the tests are, and what the planner plans for. By default the protocol's sets.
    #[serde(skip_serializing_if = "Viewers::is_default")]
    pub viewers: Viewers,
    /// The situation in which objects are photographed.
    pub situation: Situation,
    /// Further limits on camera positions.
    #[serde(skip_serializing_if = "Limits::is_empty")]
    pub limits: Limits,
}

#[cfg(test)]
impl EvaluationRequest {
    /// A small one for tests, of one seed from 0.
    pub fn quick(kind: Kind, methods: Vec<Competitor>, budgets: Vec<u32>) -> Self {
        let (settings, viewers) = (EvaluationSettings::QUICK, Viewers::Region);
        let (situation, limits) = (Situation::Free, Limits::default());
        Self { kind, methods, budgets, seeds: 1, first_seed: 0, settings, viewers, situation, limits }
    }
}

impl EvaluationRequest {
    /// Sets of test views; of several, by what their names begin with.
    pub fn sets(&self) -> &'static [&'static str] {
        if self.usual_tests() { self.kind.sets() } else { &[GIVEN_VIEWERS] }
    }

    /// Columns of a table: the sets, and the mean over them where there are several.
    pub fn columns(&self) -> Vec<&'static str> {
        if self.usual_tests() { self.kind.columns() } else { self.sets().to_vec() }
    }

    /// Whether the tests are those of the protocol, and not of viewers that were given or follow from the situation or the limits.
    pub fn usual_tests(&self) -> bool {
        let bounded = self.kind == Kind::Object && !self.limits.of_everybody().is_empty();
        self.viewers.is_default() && !self.situation.has_viewers() && !bounded
    }

    /// The viewers of the tests, where they are not the protocol's.
    pub fn test_viewers(&self) -> Option<&Viewers> {
        (!self.usual_tests()).then_some(&self.viewers)
    }

    /// Refuses what makes no sense.
    ///
    /// # Errors
    /// In a line that names the option.
    pub fn validate(&self) -> Result<()> {
        let Self { kind, methods, budgets, seeds, first_seed, settings, .. } = self;
        let twice = |what: &str| Err(Error::request(format!("{what} names something twice; give each once")));
        let usual = settings.intrinsics();
        let one = |a: &Competitor, b: &Competitor| a.chooser() == b.chooser() && a.lens(usual) == b.lens(usual);
        let same = |a: &Competitor, b: &Competitor| one(a, b) || a.name() == b.name();
        if (1..methods.len()).any(|i| methods[..i].iter().any(|other| same(other, &methods[i]))) {
            return twice("--methods");
        }
        if (1..budgets.len()).any(|i| budgets[..i].contains(&budgets[i])) {
            return twice("--budgets");
        }
        for method in methods {
            method.check(*kind)?;
            let config = method.config(kind.preset(), budgets.first().copied().unwrap_or(1).max(1), 0)?;
            // The error names an option of `camsplat plan`, which is a key here.
            config.validate().map_err(|error| Error::request(format!("method {method}: {error}")))?;
            if let Competitor::Cameras(given) = method
                && let Some(count) = given.count()
                && !budgets.is_empty()
                && !budgets.iter().any(|budget| method.takes(*budget))
            {
                let what = match (2..=1000).contains(&count) {
                    true => format!("give --budgets {count}, beside others if there are some"),
                    false => "give 2 to 1000".to_owned(),
                };
                let left_out = left_out(&given.notes);
                return Err(Error::request(format!("method {method}: these are {count} cameras; {what}{left_out}")));
            }
        }
        let two_passes = Competitor::Method(Method::OursTwoPasses);
        let in_passes = methods.iter().any(|method| *method.chooser() == two_passes);
        if in_passes && (settings.shown == Shown::True || budgets.iter().any(|views| *views < 4)) {
            return Err(Error::request(
                "--methods ours-two-passes: its second pass goes by what the photographs of the first show, 2 or more each; give \
                 --surface proxy and --budgets of 4 or more",
            ));
        }
        if settings.space == Space::Known && settings.shown == Shown::True {
            return Err(Error::request(
                "--space known: the input photos prove it together with the surface made of them; give --surface proxy, or leave it out",
            ));
        }
        if settings.inputs_from != InputsFrom::Uniform && *kind != Kind::Object {
            return Err(Error::request(
                "--inputs-from: only around objects can inputs be placed otherwise; leave it out",
            ));
        }
        if settings.baselines_from == BaselinesFrom::Sphere && *kind != Kind::Object {
            return Err(Error::request("--baselines-from sphere: only around objects is there a sphere; leave it out"));
        }
        self.situation.check(*kind, &self.viewers, settings.baselines_from)?;
        if settings.region != BY_BOUNDS && *kind != Kind::Room {
            return Err(Error::request(
                "--box and --clearance: they are of rooms, and around an object its bounds tell where cameras stand; give \
                 --preset room, or leave them out",
            ));
        }
        let limits = [
            ("--seeds", *seeds, 1, 100),
            ("--first-seed", *first_seed, 0, 1_000_000),
            ("--size", settings.size, 16, 4096),
            ("--spp", settings.samples, 1, 1 << 20),
            ("--input-spp", settings.input_samples, 1, 1 << 20),
            ("--test-spp", settings.test_samples, 1, 1 << 20),
            ("--inputs", settings.inputs, 5, 1000),
            ("--tests", settings.tests, 1, 10_000),
            ("--iterations", settings.iterations, 1, 10_000_000),
            ("--max-splats", settings.max_splats, 1, 1 << 26),
            ("--shrink", settings.shrink, 1, 64),
        ];
        let budgets = budgets.iter().map(|budget| ("--budgets", *budget, 2, 1000));
        match limits.into_iter().chain(budgets).find(|(_, value, low, high)| !(low..=high).contains(&value)) {
            Some((name, value, low, high)) => Err(Error::request(format!("{name} is {value}; give {low} to {high}"))),
            None if methods.is_empty() || self.budgets.is_empty() => {
                Err(Error::request("nothing to compare; give --methods and --budgets"))
            }
            None => Ok(()),
        }
    }

    /// Refuses several subjects where a method or a box is of one.
    ///
    /// # Errors
    /// In a line that names the method or the option.
    pub fn check_subjects(&self, subjects: usize) -> Result<()> {
        if self.settings.region.shape.is_some() && subjects > 1 {
            return Err(Error::request(format!(
                "--box: it lies in one room, and there are {subjects}; evaluate that one by itself"
            )));
        }
        let of_one = |method: &&Competitor| matches!(method, Competitor::Cameras(given) if !given.of_each_scene());
        match self.methods.iter().find(of_one) {
            Some(method) if subjects > 1 => Err(Error::request(format!(
                "method {method}: cameras stand around one scene, and there are {subjects}; give a file for each, with \
                 {{scene}} in its name, or evaluate that one by itself"
            ))),
            _ => Ok(()),
        }
    }

    /// Reads the files of layouts for subjects of these names.
    ///
    /// # Errors
    /// Where one cannot be read, or has another number of cameras than it should have.
    pub fn read_layouts(&mut self, subjects: &[String]) -> Result<()> {
        let first = u64::from(self.first_seed);
        for method in &mut self.methods {
            if let Competitor::Cameras(given) = method {
                *given = Arc::new(given.read(subjects, &self.budgets, first..first + u64::from(self.seeds))?);
            }
        }
        Ok(())
    }

    /// Whether any method chooses by a model of the subject.
    pub fn needs_model(&self) -> bool {
        self.methods.iter().any(|method| method.needs_model())
    }

    /// Every run of a subject, in the order in which they are made.
    pub fn runs(&self) -> impl Iterator<Item = Run<'_>> + '_ {
        let first = u64::from(self.first_seed);
        let of_budget = move |views: u32| (first..first + u64::from(self.seeds)).map(move |seed| (views, seed));
        let seeded = self.budgets.iter().flat_map(move |views| of_budget(*views));
        let runs = seeded.flat_map(|(views, seed)| {
            let methods = self.methods.iter().filter(move |method| method.takes(views));
            methods.map(move |method| (method, views, seed))
        });
        runs.enumerate().map(|(number, (method, views, seed))| Run { number, method, views, seed })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::evaluate::given::Given;

    /// If this failed, an empty comparison would be refused for another reason.
    #[test]
    fn nothing_to_compare_is_said() {
        let of = |methods: Vec<Competitor>, budgets: Vec<u32>| {
            EvaluationRequest::quick(Kind::Object, methods, budgets).validate()
        };
        let given = Competitor::Cameras(Arc::new(Given::parse("cameras:a").unwrap().unwrap()));
        for nothing in [of(vec![Competitor::Method(Method::Ours), given.clone()], Vec::new()), of(Vec::new(), vec![4])]
        {
            assert!(nothing.is_err_and(|error| error.to_string().contains("nothing to compare")));
        }
        assert!(of(vec![given], vec![4]).is_ok(), "its files are not read yet");
        assert!(of(vec![Competitor::Method(Method::Ours)], vec![4]).is_ok());
    }
}
