//! Kinds of subjects: an evaluation is of one kind, so that all of its subjects have the same columns, budgets and methods.

use serde::{Deserialize, Serialize};

use super::request::Method;
use crate::gaussians::config::Background;
use crate::peers::request::Method as Placing;
use crate::plan::config::Preset;
use crate::select::request::Method as Choice;
use crate::{Error, Result};

/// What an evaluation is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Objects, photographed from around them.
    Object,
    /// Rooms, photographed from inside.
    Room,
    /// Photos that have been taken: methods choose among them.
    Pool,
}

impl Kind {
    /// The kind of scenes of a preset.
    pub fn of(preset: Preset) -> Self {
        match preset {
            Preset::Object => Self::Object,
            Preset::Room => Self::Room,
        }
    }

    /// The planner's preset.
    pub fn preset(self) -> Preset {
        match self {
            Self::Object | Self::Pool => Preset::Object,
            Self::Room => Preset::Room,
        }
    }

    /// What splats of a scene are trained over, which is known before its photographs are there; those of a pool tell by
    /// themselves. Objects stand before white. A room's pictures have no alpha: what lies behind windows is in them, and over
    /// white its dark places would have to be filled with black, which stands before other views.
    pub fn background(self) -> Background {
        if self == Self::Room { Background::Black } else { Background::White }
    }

    /// Sets of test views; of several, by what their names begin with.
    pub fn sets(self) -> &'static [&'static str] {
        match self {
            Self::Object => &["half", "full", "random"],
            Self::Room => &["random"],
            Self::Pool => &["held-out"],
        }
    }

    /// Columns of a table: the sets, and the mean over them where there are several.
    pub fn columns(self) -> Vec<&'static str> {
        let mut columns = self.sets().to_vec();
        if columns.len() > 1 {
            columns.push("all");
        }
        columns
    }

    /// How a pool's photos are chosen by a method; none where it places cameras only.
    pub fn choice(method: Method) -> Option<Choice> {
        match method {
            Method::Plan(Placing::Ours) => Some(Choice::Swap),
            Method::Plan(Placing::Random) => Some(Choice::Random),
            Method::Plan(Placing::Fibonacci) => Some(Choice::Fibonacci),
            Method::Plan(Placing::Fvs) => Some(Choice::Fvs),
            Method::Plan(Placing::FvsChord) => Some(Choice::FvsChord),
            Method::Plan(Placing::FvsShared) => Some(Choice::FvsShared),
            Method::Plan(Placing::Coverage) => Some(Choice::Coverage),
            Method::Plan(Placing::Acp) => Some(Choice::Acp),
            Method::Plan(Placing::Fisher) => Some(Choice::Fisher),
            Method::Plan(Placing::Cover) => Some(Choice::Cover),
            _ => None,
        }
    }

    /// Refuses a method that does not fit subjects of this kind.
    ///
    /// # Errors
    /// In a line that names the method.
    pub fn check(self, method: Method) -> Result<()> {
        let wrong = |why: &str| Err(Error::request(format!("--methods {method}: {why}; leave it out")));
        match self {
            Self::Room if method == Method::Plan(Placing::Fibonacci) => {
                wrong("it places cameras on a sphere around an object, and a room has none")
            }
            Self::Object if matches!(method, Method::Plan(Placing::Grid | Placing::Rings)) => {
                wrong("it stands at the heights of a room; fibonacci is its like around an object")
            }
            Self::Room if method == Method::Plan(Placing::Manifold) => {
                wrong("it moves cameras over a sphere around an object, and a room has none")
            }
            Self::Pool if method == Method::Plan(Placing::FisherRetrain) => {
                wrong("it is not built for pools; camsplat select has it")
            }
            Self::Pool if Self::choice(method).is_none() => wrong("it places cameras, and of a pool photos are chosen"),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a method would fail after hours of photographs, or a table have a column twice.
    #[test]
    fn methods_and_columns_are_those_of_the_kind() {
        let fibonacci = Method::Plan(Placing::Fibonacci);
        assert!(Kind::Object.check(fibonacci).is_ok() && Kind::Pool.check(fibonacci).is_ok());
        assert!(Kind::Room.check(fibonacci).unwrap_err().to_string().contains("--methods fibonacci"));
        assert!(
            Kind::Room.check(Method::Plan(Placing::OursIterative)).is_ok()
                && Kind::Pool.check(Method::Plan(Placing::Ours)).is_ok()
        );
        assert!(
            Kind::Pool.check(Method::Plan(Placing::OursIterative)).unwrap_err().to_string().contains("ours-iterative")
        );
        assert_eq!(Kind::Object.columns(), ["half", "full", "random", "all"]);
        assert_eq!((Kind::Room.columns(), Kind::Pool.columns()), (vec!["random"], vec!["held-out"]));
    }
}
