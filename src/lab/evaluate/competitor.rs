//! The methods that are compared.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::sync::Arc;

use serde::Serialize;
use serde_json::Value;

use super::given::Given;
use super::kind::Kind;
use crate::planner::methods::{METHODS, Method};
use crate::planner::plan::config::{Config, Preset};
use crate::scene::camera::Intrinsics;
use crate::{Error, Result};

/// What is compared: a method, the planner with other settings, one of these with another lens, or cameras of the user's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Competitor {
    /// A method of this crate.
    Method(Method),
    /// The planner with some of its numbers set otherwise: `ours:KEY=VALUE[:KEY=VALUE...]`, where keys are those of
    /// [`Config`] as `plan.json` has them, such as `law.nearest` for one inside another.
    Tuned(Arc<str>),
    /// A method or a tuned planner whose cameras have another lens: `METHOD@DEGREES`.
    Through(Arc<Lens>),
    /// Cameras that are there already, `cameras:FILE` or `lenses:FILE`, at the budgets of their numbers.
    Cameras(Arc<Given>),
}

/// A method, and the lens of its cameras.
#[derive(Debug, PartialEq, Eq)]
pub struct Lens {
    name: String,
    method: Competitor,
    degrees: u32,
}

/// Fields of view that a lens may have, in degrees.
const DEGREES: RangeInclusive<u32> = 2..=160;
/// Keys that [`Competitor::Tuned`] leaves alone: the evaluation sets them itself.
const OWN: [&str; 6] = ["views", "seed", "preset", "held_out", "checkpoint_every", "objective"];
/// What [`Competitor::Tuned`] begins with, and the method whose configuration it changes.
const SET: [(&str, Method); 2] = [("ours:", Method::Ours), ("paper:", Method::Paper)];

impl Competitor {
    /// As on the command line and in tables.
    pub fn name(&self) -> &str {
        match self {
            Self::Method(method) => method.name(),
            Self::Tuned(name) => name,
            Self::Through(lens) => &lens.name,
            Self::Cameras(given) => &given.name,
        }
    }

    /// The method without its lens.
    pub fn chooser(&self) -> &Self {
        match self {
            Self::Through(lens) => &lens.method,
            method => method,
        }
    }

    /// The lens that cameras are placed with: its own of `METHOD@DEGREES`, else `usual`, which tests and viewers always have.
    pub fn lens(&self, usual: Intrinsics) -> Intrinsics {
        match self {
            Self::Through(lens) => {
                Intrinsics::from_fov(usual.width, usual.height, f64::from(lens.degrees).to_radians())
            }
            _ => usual,
        }
    }

    /// The planner's configuration, or what the baselines take of it.
    ///
    /// # Errors
    /// In a line that names the key or value of [`Competitor::Tuned`] that there is not.
    pub fn config(&self, preset: Preset, views: u32, seed: u64) -> Result<Config> {
        let plain = Config { seed, ..Config::new(preset, views) };
        Ok(match self {
            Self::Tuned(name) => {
                let (method, set) = tuned(name).unwrap_or((Method::Ours, name));
                let set: Vec<(&str, &str)> =
                    set.split(':').map(|one| one.split_once('=').unwrap_or((one, ""))).collect();
                let plain = method.planner(&plain).unwrap_or(plain);
                let twice = (1..set.len()).find(|i| set[..*i].iter().any(|(key, _)| *key == set[*i].0));
                let config = match twice {
                    Some(i) => Err(format!("{} is given twice", set[i].0)),
                    None => set.into_iter().try_fold(plain, with),
                };
                config.map_err(|what| Error::request(format!("method {name}: {what}")))?
            }
            Self::Method(method) => method.planner(&plain).unwrap_or(plain),
            Self::Through(lens) => lens.method.config(preset, views, seed)?,
            Self::Cameras(_) => plain,
        })
    }

    /// Whether it supports this number of views: given cameras support only their own numbers.
    pub fn takes(&self, views: u32) -> bool {
        !matches!(self, Self::Cameras(given) if !given.takes(views))
    }

    /// Whether it chooses by a model of the scene.
    pub fn needs_model(&self) -> bool {
        matches!(self.chooser(), Self::Method(method) if method.needs_model())
    }

    /// Rejects what does not fit subjects of a kind.
    ///
    /// # Errors
    /// In a line that names the method.
    pub fn check(&self, kind: Kind) -> Result<()> {
        let wrong = |why: &str| Err(Error::request(format!("--methods {self}: {why}; leave it out")));
        let Self::Method(method) = self.chooser() else {
            return match kind {
                Kind::Pool => wrong("it places cameras, and of a pool photos are chosen"),
                _ => Ok(()),
            };
        };
        match (kind, method) {
            (Kind::Pool, _) if matches!(self, Self::Through(_)) => wrong("photos have been taken with their lenses"),
            (Kind::Room, Method::Fibonacci) => {
                wrong("it places cameras on a sphere around an object, and a room has none")
            }
            (Kind::Object, Method::Grid | Method::Rings) => {
                wrong("it stands at the heights of a room; fibonacci is its like around an object")
            }
            (Kind::Room, Method::Manifold) => {
                wrong("it moves cameras over a sphere around an object, and a room has none")
            }
            (Kind::Pool, Method::FisherRetrain) => wrong("it is not built for pools; camsplat select has it"),
            (Kind::Object | Kind::Room, method) if !method.entry().places => {
                wrong("it chooses among photos, and of a scene cameras are placed")
            }
            (Kind::Pool, method) if !method.entry().chooses => {
                wrong("it places cameras, and of a pool photos are chosen")
            }
            _ => Ok(()),
        }
    }
}

/// The method whose configuration is changed, and what of it.
fn tuned(name: &str) -> Option<(Method, &str)> {
    SET.iter().find_map(|(begins, method)| Some((*method, name.strip_prefix(begins)?)))
}

/// The configuration with the value of a key set, or what is wrong with them.
fn with(config: Config, (key, value): (&str, &str)) -> Result<Config, String> {
    let mut fields = serde_json::to_value(&config).map_err(|error| error.to_string())?;
    let known = keys(&fields).join(", ");
    if OWN.contains(&key) {
        return Err(format!("{key} is the evaluation's; give some of {known}"));
    }
    let field = key.split('.').try_fold(&mut fields, |within, part| within.get_mut(part));
    let field = field.filter(|field| !field.is_object()).ok_or(format!("no such key: {key}; give some of {known}"))?;
    // A word that is no JSON is a string.
    *field = serde_json::from_str(value).unwrap_or_else(|_| value.into());
    serde_json::from_value(fields).map_err(|error| format!("{key} cannot be {value}: {error}"))
}

/// The keys that can be set; those inside another are written with a dot.
fn keys(fields: &Value) -> Vec<String> {
    let of = |(key, value): (&String, &Value)| match value {
        Value::Object(_) => keys(value).into_iter().map(|within| format!("{key}.{within}")).collect(),
        _ => vec![key.clone()],
    };
    let all = fields.as_object().into_iter().flatten().flat_map(of);
    all.filter(|key| !OWN.contains(&key.as_str())).collect()
}

impl Serialize for Competitor {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl fmt::Display for Competitor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Competitor {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match Given::parse(name) {
            Some(Ok(given)) if Self::of_program(&given.name).is_ok() => {
                Err(format!("{} is a method here; give another name", given.name))
            }
            Some(given) => given.map(|given| Self::Cameras(Arc::new(given))),
            None => Self::of_program(name),
        }
    }
}

impl Competitor {
    /// One that is no file.
    fn of_program(name: &str) -> Result<Self, String> {
        if let Some((method, degrees)) = name.rsplit_once('@') {
            let parsed = degrees.parse().ok().filter(|degrees| DEGREES.contains(degrees));
            let (least, most) = (DEGREES.start(), DEGREES.end());
            let degrees =
                parsed.ok_or(format!("{degrees} is no field of view; give whole degrees, {least} to {most}"))?;
            return match Self::of_program(method)? {
                Self::Through(_) => Err("it has two lenses; give one".into()),
                // One name, however it was written.
                method => {
                    let name = format!("{}@{degrees}", method.name());
                    Ok(Self::Through(Arc::new(Lens { name, method, degrees })))
                }
            };
        }
        if tuned(name).is_some() {
            return Ok(Self::Tuned(name.into()));
        }
        match Method::named(name) {
            Some(method) => Ok(Self::Method(method)),
            None => {
                let known = METHODS.iter().map(|entry| entry.name);
                let known: Vec<&str> = known
                    .chain(["ours:KEY=VALUE", "paper:KEY=VALUE", "METHOD@DEGREES", "cameras:FILE", "lenses:FILE"])
                    .collect();
                Err(format!("no such method; give some of {}", known.join(", ")))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planner::plan::gate::Gate;

    /// If this failed, a method would fail after hours of photographs, and not before.
    #[test]
    fn methods_fit_the_kind() {
        let check = |kind: Kind, name: &str| name.parse::<Competitor>().unwrap().check(kind).map_err(|e| e.to_string());
        assert!(check(Kind::Object, "fibonacci").is_ok() && check(Kind::Pool, "fibonacci").is_ok());
        assert!(check(Kind::Room, "fibonacci").unwrap_err().contains("--methods fibonacci"));
        assert!(check(Kind::Room, "paper-iterative").is_ok() && check(Kind::Pool, "ours").is_ok());
        assert!(check(Kind::Pool, "paper-iterative").unwrap_err().contains("paper-iterative"));
        assert!(check(Kind::Pool, "paper:alpha=0.2").unwrap_err().contains("photos are chosen"));
        assert!(check(Kind::Pool, "ours@80").unwrap_err().contains("with their lenses"));
        assert!(check(Kind::Room, "fibonacci@80").unwrap_err().contains("--methods fibonacci@80"));
        assert!(
            check(Kind::Pool, "assigned").is_ok()
                && check(Kind::Room, "assigned").unwrap_err().contains("among photos")
        );
    }

    /// If this failed, a method could be named and not be the one that runs.
    #[test]
    fn every_method_is_found_by_its_name() {
        let plans = METHODS.iter().filter(|entry| entry.places).map(|entry| Competitor::Method(entry.method));
        let set = Competitor::Tuned("paper:alpha=0.2:gate=pinhole_hard:scale=0.5".into());
        let lens = Lens {
            name: "ours:law.most=4.5@80".into(),
            method: Competitor::Tuned("ours:law.most=4.5".into()),
            degrees: 80,
        };
        let lens = Competitor::Through(Arc::new(lens));
        let law = lens.config(Preset::Room, 20, 3).unwrap().law().coefficients;
        assert_eq!((law.most, lens.chooser().name()), (Some(4.5), "ours:law.most=4.5"));
        let usual = Intrinsics::from_fov(64, 48, 1.0);
        assert!((lens.lens(usual).fov()[0].to_degrees() - 80.0).abs() < 1e-9 && lens.chooser().lens(usual) == usual);
        for method in plans.chain([set.clone(), lens]) {
            assert!(method.takes(7));
            assert_eq!(method.name().parse(), Ok(method));
        }
        let config = set.config(Preset::Object, 20, 3).unwrap();
        let own = config.of_paper().unwrap();
        let parsed = (own.alpha, config.gate, own.scale, config.views, config.seed);
        assert_eq!(parsed, (0.2, Gate::PinholeHard, Some(0.5), 20, 3));
        for (wrong, named) in [
            ("paper:tau=1", "lambda_reg"),
            ("ours:gate=wide", "gate cannot be wide"),
            ("ours:", "key"),
            ("ours:views=9", "views is the evaluation's"),
            ("paper:alpha=0.1:alpha=0.2", "alpha is given twice"),
            ("ours:law=1", "law.nearest"),
            ("ours:law.nearest=wide", "law.nearest cannot be wide"),
        ] {
            let error = wrong.parse::<Competitor>().unwrap().config(Preset::Object, 20, 0).unwrap_err().to_string();
            assert!(error.contains(wrong) && error.contains(named), "{error}");
        }
        for (wrong, why) in [
            ("ours@wide", "wide is no field of view"),
            ("ours@180", "180"),
            ("acp@50@60", "two lenses"),
            ("ours@80=cameras:a.json", "ours@80 is a method here"),
        ] {
            let error = wrong.parse::<Competitor>().unwrap_err();
            assert!(error.contains(why), "{error}");
        }
        assert!("cameras:".parse::<Competitor>().unwrap_err().contains("name a file"));
        assert!("nobodys".parse::<Competitor>().unwrap_err().ends_with(", cameras:FILE, lenses:FILE"));
        assert!(
            "nobodys"
                .parse::<Competitor>()
                .unwrap_err()
                .contains("ours, paper, paper-no-vds, paper-iterative, ours-two-passes, assigned")
        );
    }
}
