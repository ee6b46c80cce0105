//! What is compared, and how.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use clap::ValueEnum;
use serde::Serialize;

use super::kind::Kind;
use super::situation::Situation;
use crate::peers::request::Method as Placing;
use crate::plan::config::{Config, Objective, Preset};
use crate::plan::target::RegionChoice;
use crate::quality::viewers::Viewers;
use crate::scene::camera::{Intrinsics, Pose};
use crate::scene::limits::Limits;
use crate::{Error, Result, io};

/// A way to choose views.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(into = "&'static str")]
pub enum Method {
    /// A `--method` of `camsplat plan`: the planner, a variant of it, or a peer.
    Plan(Placing),
    /// The planner with some of its numbers set otherwise: `ours:KEY=VALUE[:KEY=VALUE...]`, where keys are those of
    /// [`Config`] as `plan.json` has them.
    Set(&'static str),
    /// Cameras that are there already, `cameras:FILE`, at the budget of their number.
    Given(&'static Given),
}

/// Where cameras stand that were placed by other means.
#[derive(Debug)]
pub struct Given {
    /// What they are called, as on the command line.
    pub name: String,
    /// Their poses in the scene's frame.
    pub poses: Vec<Pose>,
    /// What was understood of the file, for the user to check.
    pub notes: Vec<String>,
}

/// Whatever they are called.
impl PartialEq for Given {
    fn eq(&self, other: &Self) -> bool {
        self.poses == other.poses
    }
}

// Poses that were read are numbers.
impl Eq for Given {}

/// Keys that [`Method::Set`] leaves alone: the evaluation has them from elsewhere.
const OWN: [&str; 5] = ["views", "seed", "preset", "held_out", "checkpoint_every"];
/// What [`Method::Set`] begins with.
const SET: &str = "ours:";
/// The set of test views that stand where the user said.
const GIVEN_VIEWERS: &str = "viewers";
/// What [`Method::Given`] begins with.
const GIVEN: &str = "cameras:";

impl Method {
    /// As on the command line and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plan(placing) => placing.name(),
            Self::Set(name) => name,
            Self::Given(given) => &given.name,
        }
    }

    /// The planner's configuration, or what the peers take of it.
    ///
    /// # Errors
    /// In a line that names the key or value of [`Method::Set`] that there is not.
    pub fn config(self, preset: Preset, views: u32, seed: u64) -> Result<Config> {
        let plain = Config { seed, ..Config::new(preset, views) };
        Ok(match self {
            Self::Set(name) => {
                let set = name.strip_prefix(SET).unwrap_or_default().split(':');
                let set: Vec<(&str, &str)> = set.map(|one| one.split_once('=').unwrap_or((one, ""))).collect();
                // Other numbers are those of the objective, unless they are set too.
                let objective = set.iter().find(|(key, _)| *key == "objective");
                let objective = objective.and_then(|(_, value)| Objective::from_str(value, false).ok());
                let plain = match objective {
                    Some(objective) => plain.with_objective(objective),
                    None => plain,
                };
                let twice = (1..set.len()).find(|i| set[..*i].iter().any(|(key, _)| *key == set[*i].0));
                let config = match twice {
                    Some(i) => Err(format!("{} is given twice", set[i].0)),
                    None => set.into_iter().try_fold(plain, with),
                };
                config.map_err(|what| Error::request(format!("method {name}: {what}")))?
            }
            Self::Plan(placing) => placing.planner(&plain).unwrap_or(plain),
            Self::Given(_) => plain,
        })
    }

    /// Whether it can be asked for so many views: cameras that are there are as many as they are.
    pub fn takes(self, views: u32) -> bool {
        !matches!(self, Self::Given(given) if given.poses.len() != views as usize)
    }

    /// Whether it chooses by a model of the scene.
    pub fn needs_model(self) -> bool {
        matches!(self, Self::Plan(placing) if placing.needs_model())
    }
}

/// The configuration with the value of a key set, or what is wrong with them.
fn with(config: Config, (key, value): (&str, &str)) -> Result<Config, String> {
    let fields = serde_json::to_value(&config).ok().and_then(|config| config.as_object().cloned());
    let mut fields = fields.ok_or("the configuration cannot be written")?;
    let known: Vec<&str> = fields.keys().map(String::as_str).filter(|key| !OWN.contains(key)).collect();
    let known = known.join(", ");
    if OWN.contains(&key) {
        return Err(format!("{key} is the evaluation's; give some of {known}"));
    }
    let field = fields.get_mut(key).ok_or(format!("no such key: {key}; give some of {known}"))?;
    // A word that is no JSON is a string.
    *field = serde_json::from_str(value).unwrap_or_else(|_| value.into());
    serde_json::from_value(fields.into()).map_err(|error| format!("{key} cannot be {value}: {error}"))
}

impl From<Method> for &'static str {
    fn from(method: Method) -> Self {
        method.name()
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        if name.starts_with(SET) {
            // A command names a handful, for as long as it runs: methods stay small and can be copied.
            return Ok(Self::Set(Box::leak(name.into())));
        }
        if let Some(file) = name.strip_prefix(GIVEN) {
            if file.is_empty() {
                return Err("name a file behind cameras:".into());
            }
            let read = io::read_cameras_with_notes(Path::new(file)).map_err(|error| error.to_string());
            let (cameras, notes) = read?;
            let poses = cameras.iter().map(|camera| camera.pose).collect();
            return Ok(Self::Given(Box::leak(Box::new(Given { name: name.into(), poses, notes }))));
        }
        Placing::from_str(name, false).map(Self::Plan).map_err(|_| {
            let known = Placing::value_variants().iter().map(|placing| placing.name());
            let known = known.chain(["ours:KEY=VALUE", "cameras:FILE"]);
            format!("no such method; give some of {}", known.collect::<Vec<_>>().join(", "))
        })
    }
}

/// What the methods are shown of the scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Shown {
    /// A surface made from the input photos
    Proxy,
    /// The scene's own mesh
    True,
}

/// Where around an object peers may put cameras.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum PeersFrom {
    /// Anywhere in the region that the planner has too
    Region,
    /// On its outer sphere, as the discrete methods of the paper do
    Sphere,
}

/// How the places of an object's input photos are chosen, which people choose in their own ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum InputsFrom {
    /// From all around, evenly
    Uniform,
    /// From all around, at random
    Random,
    /// Evenly from one side, a third of the sphere
    Biased,
}

/// A region that follows from a scene's bounds.
const BY_BOUNDS: RegionChoice = RegionChoice { shape: None, floor: None, clearance: None };

/// The size of everything.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Settings {
    /// Side of the pictures in pixels.
    pub size: u32,
    /// Samples of a pixel.
    pub samples: u32,
    /// Samples of a pixel of the input photos.
    pub input_samples: u32,
    /// Samples of a pixel of the test views: their noise counts against whatever is compared with them.
    pub test_samples: u32,
    /// Input photos: what methods are shown is made from them.
    pub inputs: u32,
    /// Where they are taken from.
    pub inputs_from: InputsFrom,
    /// Views of each set of tests.
    pub tests: u32,
    /// Iterations of training.
    pub iterations: u32,
    /// Most splats.
    pub max_splats: u32,
    /// What the methods are shown of the scene.
    pub shown: Shown,
    /// Each pixel of a pool's photo is a square of so many stored ones.
    pub shrink: u32,
    /// Where around an object peers may put cameras.
    pub peers_from: PeersFrom,
    /// What the user says of where in a room cameras may stand.
    pub region: RegionChoice,
    /// Whether splats are trained and looked at with the filter against aliasing.
    pub antialiased: bool,
}

impl Settings {
    /// The whole protocol, for a GPU.
    pub const WHOLE: Self = Self {
        size: 800,
        samples: 256,
        input_samples: 256,
        test_samples: 256,
        inputs: 10,
        inputs_from: InputsFrom::Uniform,
        tests: 200,
        iterations: 30_000,
        max_splats: 1_000_000,
        shown: Shown::Proxy,
        shrink: 1,
        peers_from: PeersFrom::Region,
        region: BY_BOUNDS,
        antialiased: false,
    };
    /// What two cores do in minutes.
    pub const QUICK: Self = Self {
        size: 96,
        samples: 8,
        input_samples: 8,
        test_samples: 8,
        inputs: 10,
        inputs_from: InputsFrom::Uniform,
        tests: 12,
        iterations: 300,
        max_splats: 5000,
        shown: Shown::Proxy,
        shrink: 8,
        peers_from: PeersFrom::Region,
        region: BY_BOUNDS,
        antialiased: false,
    };

    /// Horizontal field of view of all cameras that photograph a scene, in degrees: the planner's default.
    pub const FOV_DEG: f64 = 50.0;

    /// The camera of all photographs.
    pub fn intrinsics(&self) -> Intrinsics {
        Intrinsics::from_fov(self.size, self.size, Self::FOV_DEG.to_radians())
    }
}

/// What is asked for.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Request {
    /// What all of the evaluation is on.
    pub kind: Kind,
    /// Methods, each once.
    pub methods: Vec<Method>,
    /// Numbers of views, each once.
    pub budgets: Vec<u32>,
    /// Runs of each.
    pub seeds: u32,
    /// The seed of the first of these; the others follow.
    pub first_seed: u32,
    /// The size of everything.
    pub settings: Settings,
    /// From where people will look: where the tests are, and what the planner plans for. By default the protocol's sets.
    #[serde(skip_serializing_if = "Viewers::is_default")]
    pub viewers: Viewers,
    /// What objects are photographed in.
    pub situation: Situation,
    /// What limits where cameras stand beside that.
    #[serde(skip_serializing_if = "Limits::is_empty")]
    pub limits: Limits,
}

impl Request {
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

    /// The viewers that the tests are of, where they are not those of the protocol.
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
        if (1..methods.len()).any(|i| methods[..i].contains(&methods[i])) {
            return twice("--methods");
        }
        if (1..budgets.len()).any(|i| budgets[..i].contains(&budgets[i])) {
            return twice("--budgets");
        }
        for method in methods {
            kind.check(*method)?;
            let config = method.config(kind.preset(), budgets.first().copied().unwrap_or(1).max(1), 0)?;
            // What is told is an option of `camsplat plan`, which is a key here.
            config.validate().map_err(|error| Error::request(format!("method {method}: {error}")))?;
            if let Method::Given(Given { poses, .. }) = method
                && !budgets.is_empty()
                && !budgets.iter().any(|budget| method.takes(*budget))
            {
                let count = poses.len();
                let what = match (2..=1000).contains(&count) {
                    true => {
                        format!("these are {count} cameras; give --budgets {count}, beside others if there are some")
                    }
                    false => format!("these are {count} cameras; give 2 to 1000"),
                };
                return Err(Error::request(format!("method {method}: {what}")));
            }
        }
        let in_passes = methods.contains(&Method::Plan(Placing::OursTwoPasses));
        if in_passes && (settings.shown == Shown::True || budgets.iter().any(|views| *views < 4)) {
            return Err(Error::request(
                "--methods ours-two-passes: its second pass goes by what the photographs of the first show, 2 or more each; give \
                 --surface proxy and --budgets of 4 or more",
            ));
        }
        if settings.inputs_from != InputsFrom::Uniform && *kind != Kind::Object {
            return Err(Error::request(
                "--inputs-from: only around objects can inputs be placed otherwise; leave it out",
            ));
        }
        if settings.peers_from == PeersFrom::Sphere && *kind != Kind::Object {
            return Err(Error::request("--peers-from sphere: only around objects is there a sphere; leave it out"));
        }
        self.situation.check(*kind, &self.viewers, settings.peers_from)?;
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
        match self.methods.iter().find(|method| matches!(method, Method::Given(_))) {
            Some(method) if subjects > 1 => Err(Error::request(format!(
                "method {method}: cameras stand around one scene, and there are {subjects}; evaluate that one by itself"
            ))),
            _ => Ok(()),
        }
    }

    /// Whether any method chooses by a model of the subject.
    pub fn needs_model(&self) -> bool {
        self.methods.iter().any(|method| method.needs_model())
    }

    /// Every run: method, number of views and seed, in the order in which they are made.
    pub fn runs(&self) -> impl Iterator<Item = (Method, u32, u64)> + '_ {
        let first = u64::from(self.first_seed);
        let of_budget = move |views: u32| (first..first + u64::from(self.seeds)).map(move |seed| (views, seed));
        let seeded = self.budgets.iter().flat_map(move |views| of_budget(*views));
        seeded.flat_map(|(views, seed)| {
            let methods = self.methods.iter().filter(move |method| method.takes(views));
            methods.map(move |method| (*method, views, seed))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::config::Gate;

    /// If this failed, who asks for nothing would be told of something else.
    #[test]
    fn nothing_to_compare_is_said() {
        let of = |methods: Vec<Method>, budgets: Vec<u32>| {
            let (kind, settings) = (Kind::Object, Settings::QUICK);
            let viewers = Viewers::Region;
            let (situation, limits) = (Situation::Free, Limits::default());
            Request { kind, methods, budgets, seeds: 1, first_seed: 0, settings, viewers, situation, limits }.validate()
        };
        let given = Given { name: "cameras:a".into(), poses: Vec::new(), notes: Vec::new() };
        let given = Method::Given(Box::leak(Box::new(given)));
        for nothing in [of(vec![Method::Plan(Placing::Ours), given], Vec::new()), of(Vec::new(), vec![4])] {
            assert!(nothing.is_err_and(|error| error.to_string().contains("nothing to compare")));
        }
        assert!(of(vec![given], vec![4]).is_err_and(|error| error.to_string().contains("0 cameras; give 2 to 1000")));
        assert!(of(vec![Method::Plan(Placing::Ours)], vec![4]).is_ok());
    }

    /// If this failed, a method could be named and not be the one that runs.
    #[test]
    fn every_method_is_found_by_its_name() {
        let plans = Placing::value_variants().iter().map(|placing| Method::Plan(*placing));
        let set = Method::Set("ours:alpha=0.2:gate=pinhole_hard:scale=0.5");
        for method in plans.chain([set]) {
            assert_eq!(method.name().parse(), Ok(method));
            assert!(method.takes(7));
        }
        let config = set.config(Preset::Object, 20, 3).unwrap();
        let told = (config.alpha, config.gate, config.scale, config.views, config.seed);
        assert_eq!(told, (0.2, Gate::PinholeHard, Some(0.5), 20, 3));
        for (wrong, named) in [
            ("ours:tau=1", "lambda_reg"),
            ("ours:gate=wide", "gate cannot be wide"),
            ("ours:", "key"),
            ("ours:views=9", "views is the evaluation's"),
            ("ours:alpha=0.1:alpha=0.2", "alpha is given twice"),
        ] {
            let error = wrong.parse::<Method>().unwrap().config(Preset::Object, 20, 0).unwrap_err().to_string();
            assert!(error.contains(wrong) && error.contains(named), "{error}");
        }
        assert!("cameras:".parse::<Method>().unwrap_err().contains("name a file"));
        assert!("nobodys".parse::<Method>().unwrap_err().ends_with(", cameras:FILE"));
        assert!(
            "nobodys"
                .parse::<Method>()
                .unwrap_err()
                .contains("ours, ours-no-vds, ours-iterative, ours-two-passes, random")
        );
    }
}
