//! The way to a photo that is to be taken, from one that has been.

use glam::DVec3;
use serde::Serialize;

use crate::files::photos::PhotoSet;
use crate::scene::camera::{Camera, Pose};
use crate::scene::directions::{RelativeMove, Unit};
use crate::scene::region::Region;

/// A photo to take, and how to get there.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Way {
    /// The photo to start from.
    pub from: String,
    /// How to get from there to it, in words.
    pub words: String,
    /// Lengths of the way in units of the scene, to the right, ahead (level, as the photo looks) and up.
    pub right: f64,
    /// See `right`.
    pub ahead: f64,
    /// See `right`.
    pub up: f64,
    /// Turn to the right in degrees.
    pub turn_right_deg: f64,
    /// Tilt up in degrees.
    pub tilt_up_deg: f64,
    /// How far it looks above the horizon, in degrees.
    pub pitch_deg: f64,
    /// Height of the lens above the floor in units of the scene, where there is a floor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height: Option<f64>,
    /// Where it is, camera axes X right, Y down, Z forward.
    pub pose: Pose,
}

impl Way {
    /// From a photo to where another is to be taken.
    pub fn new(from: &Camera, to: &Camera, region: &Region, unit: &Unit) -> Self {
        let way = RelativeMove::new(&from.pose, &to.pose, region.up);
        Self {
            from: from.name.clone(),
            words: way.words(unit),
            right: way.right,
            ahead: way.ahead,
            up: way.up,
            turn_right_deg: way.turn.to_degrees(),
            tilt_up_deg: way.tilt.to_degrees(),
            pitch_deg: way.pitch.to_degrees(),
            height: region.floor.map(|floor| to.pose.position.dot(region.up) - floor),
            pose: to.pose,
        }
    }
}

/// What lengths are said in among the photos of a capture, and that in words: metres where their length is known, else steps of the
/// photographer, with two photos that are about one apart, or units of the scene where there is no step yet.
pub fn unit(set: &PhotoSet, up: DVec3) -> (Unit, String) {
    let step = set.step();
    if set.metre.is_none() && step <= 0.0 {
        return (Unit::Step(1.0), "a unit of the scene".into());
    }
    let unit = set.metre.map_or(Unit::Step(step), Unit::Metre);
    let said = match (unit, apart(set, step, up)) {
        (Unit::Step(_), Some([a, b])) => format!("{}, which is about as far as from {a} to {b}", unit.name()),
        _ => unit.name().into(),
    };
    (unit, said)
}

/// The photos that are most nearly a step apart on the level, as a map shows it.
fn apart(set: &PhotoSet, step: f64, up: DVec3) -> Option<[&str; 2]> {
    let photos: Vec<&Camera> = set.photos.iter().map(|photo| &photo.camera).collect();
    let pairs = photos.iter().enumerate().flat_map(|(i, a)| photos[..i].iter().map(move |b| (*b, *a)));
    let off = |(a, b): &(&Camera, &Camera)| {
        let way = b.pose.position - a.pose.position;
        (way.length() - step).abs() + way.dot(up).abs()
    };
    pairs.min_by(|a, b| off(a).total_cmp(&off(b))).map(|(a, b)| [&a.name[..], &b.name[..]])
}
