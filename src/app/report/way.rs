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
    let pair = apart(set, up);
    let step = pair.and_then(|[a, b]| between(set, a, b)).unwrap_or(0.0);
    if set.metre.is_none() && step <= 0.0 {
        return (Unit::Step(1.0), "a unit of the scene".into());
    }
    let unit = set.metre.map_or(Unit::Step(step), Unit::Metre);
    let said = match (unit, pair) {
        (Unit::Step(_), Some([a, b])) => format!("{}, as far as from {a} to {b}", unit.name()),
        _ => unit.name().into(),
    };
    (unit, said)
}

/// The photos that a step lies between: those of the set's own, where both are in it, else those that are most nearly a step apart on the
/// level, as a map shows it.
pub fn apart(set: &PhotoSet, up: DVec3) -> Option<[&str; 2]> {
    if let Some([a, b]) = &set.apart
        && between(set, a, b).is_some_and(|step| step > 0.0)
    {
        return Some([a, b]);
    }
    let step = set.step();
    let photos: Vec<&Camera> = set.photos.iter().map(|photo| &photo.camera).collect();
    let pairs = photos.iter().enumerate().flat_map(|(i, a)| photos[..i].iter().map(move |b| (*b, *a)));
    let off = |(a, b): &(&Camera, &Camera)| {
        let way = b.pose.position - a.pose.position;
        (way.length() - step).abs() + way.dot(up).abs()
    };
    pairs.min_by(|a, b| off(a).total_cmp(&off(b))).map(|(a, b)| [&a.name[..], &b.name[..]])
}

/// How far apart two photos are, by their names; none where one is not in the set.
fn between(set: &PhotoSet, a: &str, b: &str) -> Option<f64> {
    let place = |name: &str| set.photos.iter().find(|photo| photo.camera.name == name).map(|p| p.camera.pose.position);
    Some(place(a)?.distance(place(b)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::photos::Photo;
    use crate::scene::camera::Intrinsics;
    use crate::scene::lens::Distortion;

    /// If this failed, "one step" would be another length each time that photos are added, while the photographer's are as they were.
    #[test]
    fn a_step_stays_as_long_as_its_photos_are_there() {
        let photo = |(i, x): (usize, &f64)| Photo {
            camera: Camera {
                name: format!("{i}.jpg"),
                pose: Pose::looking(DVec3::new(*x, 0.0, 0.0), DVec3::Y, DVec3::Z),
                intrinsics: Intrinsics::from_fov(64, 48, 1.0),
            },
            distortion: Distortion::default(),
            image: None,
            mask: None,
        };
        let of = |places: &[f64], apart: Option<[String; 2]>| {
            let photos = places.iter().enumerate().map(photo).collect();
            PhotoSet { photos, apart, ..PhotoSet::default() }
        };
        let (first, more) = ([0.0, 1.0, 2.0, 3.0], [0.0, 1.0, 2.0, 3.0, 9.0, 15.0, 21.0, 27.0, 33.0, 39.0]);
        let set = of(&first, None);
        let pair = apart(&set, DVec3::Z).unwrap().map(str::to_owned);
        assert_eq!(unit(&set, DVec3::Z).0, Unit::Step(1.0));
        let other = unit(&of(&more, None), DVec3::Z).0;
        assert!(other.length() > 2.0, "{other:?} should be another by now");
        assert_eq!(unit(&of(&more, Some(pair.clone())), DVec3::Z), unit(&set, DVec3::Z));
        // One of them was deleted.
        let gone = Some([pair[0].clone(), "gone.jpg".into()]);
        assert_eq!(unit(&of(&more, gone), DVec3::Z).0, other);
    }
}
