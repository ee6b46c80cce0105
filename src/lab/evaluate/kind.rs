//! Kinds of subjects: an evaluation is of one kind, so that all of its subjects have the same columns, budgets and methods.

use serde::{Deserialize, Serialize};

use crate::planner::plan::config::Preset;
use crate::splats::config::Background;

/// The kind of an evaluation's subjects.
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

    /// What splats of a scene are trained over, which is known before its photographs are there; those of a pool determine it
    /// themselves. Objects are on a white background. A room's pictures have no alpha: what lies behind windows is in them, and
    /// on white its dark places would be filled with black Gaussians, which occlude other views.
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
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a table would have a column twice or lack one.
    #[test]
    fn columns_are_those_of_the_kind() {
        assert_eq!(Kind::Object.columns(), ["half", "full", "random", "all"]);
        assert_eq!((Kind::Room.columns(), Kind::Pool.columns()), (vec!["random"], vec!["held-out"]));
    }
}
