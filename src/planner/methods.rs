//! Every way to place cameras or to choose photos that this crate has: the one table of their names.
//!
//! `camsplat plan --method` takes those that place cameras, `camsplat select --method` those that choose among photos, and
//! `camsplat evaluate --methods` all that fit its subjects.

use serde::{Deserialize, Serialize};

/// A way to place cameras, or to choose photos from a pool.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "&'static str", try_from = "String")]
pub enum Method {
    /// The planner; of a pool the choice that swaps improve.
    Ours,
    /// The paper's objective.
    Paper,
    /// The same without scores.
    PaperNoVds,
    /// The same without scores, one view after another.
    PaperIterative,
    /// The planner in two passes.
    OursTwoPasses,
    /// A different photo for each planned camera, by the least sum of distances.
    Assigned,
    /// For each planned camera the nearest photo.
    Nearest,
    /// At random.
    Random,
    /// Spherical Fibonacci points.
    Fibonacci,
    /// A grid at eye height.
    Grid,
    /// Rings along the walls.
    Rings,
    /// Farthest view sampling by angle.
    Fvs,
    /// Farthest view sampling by distance.
    FvsChord,
    /// Farthest view sampling by angle and shared points.
    FvsShared,
    /// Greedy coverage.
    Coverage,
    /// Greedy on expected quality.
    Greedy,
    /// Uniformity and frequency at nodes of a grid.
    Acp,
    /// The same with nodes that the surface hides.
    AcpHidden,
    /// Fisher information about a trained model.
    Fisher,
    /// The same by D-optimality.
    PopD,
    /// The same by T-optimality.
    PopT,
    /// As the first with a model that is trained on.
    FisherRetrain,
    /// What a trained model shows from directions not seen yet.
    Cover,
    /// Where pictures of a trained model differ most under its noise.
    Manifold,
}

/// A row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Which method.
    pub method: Method,
    /// Its name on the command line, in tables and in records.
    pub name: &'static str,
    /// Another name that the command line takes.
    pub alias: Option<&'static str>,
    /// What it does, for the help.
    pub about: &'static str,
    /// Whether it places cameras.
    pub places: bool,
    /// Whether it chooses among photos.
    pub chooses: bool,
}

const fn entry(method: Method, name: &'static str, [places, chooses]: [bool; 2], about: &'static str) -> Entry {
    Entry { method, name, alias: None, about, places, chooses }
}

const PLACES: [bool; 2] = [true, false];
const CHOOSES: [bool; 2] = [false, true];
const BOTH: [bool; 2] = [true, true];

/// The table, in the order of the help.
pub const METHODS: [Entry; 24] = [
    Entry {
        alias: Some("swap"),
        ..entry(
            Method::Ours,
            "ours",
            BOTH,
            "The planner; among photos, swaps that lower the expected error, starting from the best simple choice",
        )
    },
    entry(
        Method::Paper,
        "paper",
        PLACES,
        "The paper's objective: point cameras whose pictures should be evenly bright",
    ),
    entry(Method::PaperNoVds, "paper-no-vds", PLACES, "The paper's objective without scores"),
    entry(
        Method::PaperIterative,
        "paper-iterative",
        PLACES,
        "The paper's objective without scores, one view after another",
    ),
    entry(
        Method::OursTwoPasses,
        "ours-two-passes",
        PLACES,
        "The planner in two passes, the second on what the photographs of the first show too; only in `evaluate`",
    ),
    entry(
        Method::Assigned,
        "assigned",
        CHOOSES,
        "A different photo for each planned camera, by the least sum of distances",
    ),
    entry(
        Method::Nearest,
        "nearest",
        CHOOSES,
        "For each planned camera the nearest photo, as in the paper: perhaps fewer than asked for",
    ),
    entry(Method::Random, "random", BOTH, "At random; placed cameras look in around an object, anywhere in a room"),
    entry(
        Method::Fibonacci,
        "fibonacci",
        BOTH,
        "Spherical Fibonacci points in a random rotation, where cameras can stand around an object; among photos, the nearest to each point",
    ),
    entry(Method::Grid, "grid", PLACES, "In a room on an even grid at eye height, in four level directions a place"),
    entry(Method::Rings, "rings", PLACES, "In a room on three level rings along the walls, looking across"),
    entry(Method::Fvs, "fvs", BOTH, "Farthest view sampling by the angle between camera centres (NeRF Director)"),
    Entry {
        alias: Some("fvs-square"),
        ..entry(
            Method::FvsChord,
            "fvs-chord",
            BOTH,
            "Farthest view sampling by the distance between camera centres, or its square, which gives the same",
        )
    },
    entry(
        Method::FvsShared,
        "fvs-shared",
        BOTH,
        "Farthest view sampling by angle and shared points (NeRF Director's photogrammetric distance)",
    ),
    entry(Method::Coverage, "coverage", BOTH, "Greedy on points seen by one view, then by three"),
    entry(Method::Greedy, "greedy", PLACES, "Greedy on the expected quality that `ours` descends, among random poses"),
    entry(
        Method::Acp,
        "acp",
        BOTH,
        "Greedy on the uniformity of view directions and the frequency at nodes of a grid (Kopanas and Drettakis)",
    ),
    entry(
        Method::AcpHidden,
        "acp-hidden",
        BOTH,
        "As acp, where a view does not see nodes that the surface hides from it",
    ),
    entry(Method::Fisher, "fisherrf", BOTH, "Greedy on the Fisher information about a trained model (FisherRF)"),
    entry(Method::PopD, "pop-d", BOTH, "As fisherrf, by the determinant of the information (POp-GS, D-optimality)"),
    entry(Method::PopT, "pop-t", BOTH, "As fisherrf, by the trace of the information (POp-GS, T-optimality)"),
    entry(
        Method::FisherRetrain,
        "fisherrf-retrain",
        BOTH,
        "As fisherrf, with a model trained on the views chosen so far; only in `evaluate` and `select`",
    ),
    entry(Method::Cover, "cover", BOTH, "Greedy on what a trained model shows from directions not seen yet (COVER)"),
    entry(
        Method::Manifold,
        "manifold",
        PLACES,
        "One camera after another to where pictures of a trained model differ most under its noise (manifold sampling)",
    ),
];

impl Method {
    /// Those that every choice among photos is put beside.
    pub const BASELINES: [Self; 8] = [
        Self::Assigned,
        Self::Nearest,
        Self::Random,
        Self::Fibonacci,
        Self::Fvs,
        Self::FvsChord,
        Self::FvsShared,
        Self::Coverage,
    ];

    /// Its row of the table.
    pub fn entry(self) -> &'static Entry {
        // A row for each, in this order, as a test holds.
        &METHODS[self as usize]
    }

    /// As on the command line, in tables and in records.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// The one of this name or alias.
    pub fn named(name: &str) -> Option<Self> {
        METHODS.iter().find(|entry| entry.name == name || entry.alias == Some(name)).map(|entry| entry.method)
    }

    /// Whether it minimises the paper's objective.
    pub fn is_paper(self) -> bool {
        matches!(self, Self::Paper | Self::PaperNoVds | Self::PaperIterative)
    }

    /// Whether it chooses by a model of the scene.
    pub fn needs_model(self) -> bool {
        matches!(self, Self::Fisher | Self::PopD | Self::PopT | Self::Cover | Self::Manifold)
    }

    /// Whether it takes photographs of the views that it chooses, while it chooses.
    pub fn needs_photographs(self) -> bool {
        matches!(self, Self::FisherRetrain | Self::OursTwoPasses)
    }
}

impl From<Method> for &'static str {
    fn from(method: Method) -> Self {
        method.name()
    }
}

impl TryFrom<String> for Method {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::named(&name).ok_or(format!("no such method: {name}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a method would have one name on the command line and another in tables or records, or two would share one.
    #[test]
    fn a_method_has_one_name_everywhere() {
        for (i, entry) in METHODS.iter().enumerate() {
            assert_eq!((entry.method as usize, entry.method.name()), (i, entry.name));
            assert_eq!(Method::named(entry.name), Some(entry.method));
            assert_eq!(serde_json::to_value(entry.method).unwrap(), entry.name);
            assert_eq!(serde_json::from_value::<Method>(entry.name.into()).unwrap(), entry.method);
            assert!(entry.places || entry.chooses, "{}", entry.name);
            let taken = METHODS.iter().filter(|other| other.alias == Some(entry.name)).count();
            assert_eq!(taken, 0, "{} is another's alias", entry.name);
            assert!(entry.alias.is_none_or(|alias| Method::named(alias) == Some(entry.method)), "{:?}", entry.alias);
        }
        // What earlier programs wrote of selections.
        assert_eq!(serde_json::from_value::<Method>("swap".into()).unwrap(), Method::Ours);
        assert!(serde_json::from_value::<Method>("zebra".into()).is_err());
    }
}
