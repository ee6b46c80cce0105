//! What a file of a mission says, read back from its bytes by its format alone.

use super::georeference::Geodetic;

/// How high a place is said to be, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Height {
    /// Above the take-off.
    AboveTakeoff(f64),
    /// Altitude, in the reference of the plan's.
    Altitude(f64),
}

/// A place on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Degrees north.
    pub latitude: f64,
    /// Degrees east.
    pub longitude: f64,
    /// How high.
    pub height: Height,
}

/// A photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photo {
    /// From where.
    pub place: Place,
    /// Degrees clockwise from north.
    pub heading: f64,
    /// Degrees above the horizon.
    pub pitch: f64,
}

/// All that a file says of the flight; none of what its format does not hold.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flown {
    /// All places in their order.
    pub way: Vec<Place>,
    /// All photos in their order.
    pub photos: Vec<Photo>,
    /// Metres per second.
    pub speed: Option<f64>,
    /// Where it takes off.
    pub home: Option<Geodetic>,
    /// Metres above the take-off to which it climbs first.
    pub climb: Option<f64>,
    /// Outlines of areas that are kept out of: degrees east and north.
    pub zones: Option<Vec<Vec<[f64; 2]>>>,
    /// What is wrong in the file by itself.
    pub faults: Vec<String>,
}

impl Flown {
    /// Takes note of something wrong unless it holds.
    pub fn require(&mut self, holds: bool, otherwise: impl FnOnce() -> String) {
        if !holds {
            self.faults.push(otherwise());
        }
    }
}

/// Whether two values are the same, whichever way their numbers are written.
pub fn same(a: &serde_json::Value, b: &serde_json::Value) -> bool {
    a == b || a.as_f64().is_some_and(|a| Some(a) == b.as_f64())
}

/// A number in a text, which has to be finite.
pub fn number(text: &str) -> Result<f64, String> {
    let number = text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| format!("{:?} is no number", text.trim()))
}
