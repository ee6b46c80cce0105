//! The way from one camera to another as a person goes it: ahead, aside, up; turn, tilt.

use glam::DVec3;

use super::camera::Pose;

/// From where one photo was taken to where another is to be, in the level frame of the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeMove {
    /// How far to the right, ahead and up, in units of the scene.
    pub right: f64,
    /// Ahead along the level part of where the first looks.
    pub ahead: f64,
    /// How far up, in units of the scene.
    pub up: f64,
    /// Turn to the right, in radians.
    pub turn: f64,
    /// Tilt upwards, in radians.
    pub tilt: f64,
    /// How far the second looks above the horizon, in radians.
    pub pitch: f64,
}

impl RelativeMove {
    /// The way from one pose to another, where `up` is up.
    pub fn new(from: &Pose, to: &Pose, up: DVec3) -> Self {
        let offset = to.position - from.position;
        let ahead = heading(from, up);
        let right = ahead.cross(up);
        let toward = heading(to, up);
        let pitch = |pose: &Pose| pose.forward().dot(up).clamp(-1.0, 1.0).asin();
        Self {
            right: offset.dot(right),
            ahead: offset.dot(ahead),
            up: offset.dot(up),
            turn: toward.dot(right).atan2(toward.dot(ahead)),
            tilt: pitch(to) - pitch(from),
            pitch: pitch(to),
        }
    }

    /// In words: moves first, then the turn from where the first looks, then how far above or below the horizon the second looks, since
    /// a camera's level shows that and no tilt since the last photo. Lengths are so many of `unit`.
    pub fn words(&self, unit: &Unit) -> String {
        let moved = [(self.right, ["right", "left"]), (self.ahead, ["forward", "back"]), (self.up, ["up", "down"])];
        let moves: Vec<String> = moved
            .into_iter()
            .filter_map(|(length, [positive, negative])| {
                let much = unit.words(length.abs())?;
                Some(format!("{much} {}", if length > 0.0 { positive } else { negative }))
            })
            .collect();
        let turn = match (self.turn.to_degrees() / 5.0).round() * 5.0 {
            0.0 => "do not turn".into(),
            degrees if degrees > 0.0 => format!("turn right {degrees:.0}°"),
            degrees => format!("turn left {:.0}°", -degrees),
        };
        let aim = match self.pitch.to_degrees().round() {
            0.0 => "aim level".into(),
            degrees if degrees > 0.0 => format!("aim {degrees:.0}° up"),
            degrees => format!("aim {:.0}° down", -degrees),
        };
        let moves = if moves.is_empty() { "stay there".into() } else { moves.join(", ") };
        format!("{moves}; {turn}, {aim}")
    }
}

/// Where a pose heads on level ground; where it looks straight up or down, as its picture's top or bottom shows it.
fn heading(pose: &Pose, up: DVec3) -> DVec3 {
    let forward = pose.forward();
    let level = forward.reject_from_normalized(up);
    let other = if forward.dot(up) < 0.0 { pose.up() } else { -pose.up() };
    let flat = if level.length() > 0.05 { level } else { other.reject_from_normalized(up) };
    flat.normalize_or(up.any_orthonormal_vector())
}

/// What lengths are said in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// Metres, each so long in units of the scene.
    Metre(f64),
    /// Steps between neighbouring photos.
    Step(f64),
}

impl Unit {
    /// A length in units of the scene, in words; none where it is too short to say.
    fn words(&self, length: f64) -> Option<String> {
        match *self {
            Self::Metre(metre) => match length / metre {
                metres if metres < 0.03 => None,
                metres if metres < 0.95 => Some(format!("{:.0} cm", 5.0 * (20.0 * metres).round().max(1.0))),
                metres => Some(format!("{metres:.1} m")),
            },
            Self::Step(step) => match length / step {
                steps if steps < 0.1 => None,
                steps if (0.45..0.55).contains(&steps) => Some("half a step".into()),
                steps if (0.95..1.05).contains(&steps) => Some("one step".into()),
                steps => Some(format!("{steps:.1} steps")),
            },
        }
    }

    /// One of it, in words.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Metre(_) => "a metre",
            Self::Step(_) => "a step",
        }
    }

    /// Its length in units of the scene.
    pub fn length(&self) -> f64 {
        match *self {
            Self::Metre(length) | Self::Step(length) => length,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a person would be sent to the left for the right, or look up for down.
    #[test]
    fn a_way_is_said_as_a_person_goes_it() {
        // Facing east (+X) with up +Z: right is south (-Y).
        let from = Pose::looking(DVec3::new(1.0, 1.0, 1.5), DVec3::X, DVec3::Z);
        let to = Pose::looking(DVec3::new(3.0, 0.0, 2.0), DVec3::new(1.0, -1.0, -0.5), DVec3::Z);
        let way = RelativeMove::new(&from, &to, DVec3::Z);
        assert!((way.right - 1.0).abs() < 1e-9 && (way.ahead - 2.0).abs() < 1e-9 && (way.up - 0.5).abs() < 1e-9);
        assert!((way.turn.to_degrees() - 45.0).abs() < 1e-9 && way.tilt < 0.0 && way.pitch == way.tilt);
        assert_eq!(
            way.words(&Unit::Step(1.0)),
            "one step right, 2.0 steps forward, half a step up; turn right 45°, aim 19° down"
        );
        assert_eq!(way.words(&Unit::Metre(1.0)), "1.0 m right, 2.0 m forward, 50 cm up; turn right 45°, aim 19° down");
        let back = RelativeMove::new(&to, &from, DVec3::Z);
        assert!((back.turn + way.turn).abs() < 1e-9 && back.ahead < 0.0 && back.tilt > 0.0);
        assert_eq!(
            RelativeMove::new(&from, &from, DVec3::Z).words(&Unit::Step(1.0)),
            "stay there; do not turn, aim level"
        );
    }

    /// If this failed, photos from above would have no left and right.
    #[test]
    fn who_looks_straight_down_has_a_heading() {
        let down = Pose::looking(DVec3::Z, DVec3::NEG_Z, DVec3::X);
        let to = Pose { position: DVec3::new(0.5, -2.0, 1.0), ..down };
        let way = RelativeMove::new(&down, &to, DVec3::Z);
        assert!((way.ahead - 0.5).abs() < 1e-9 && (way.right - 2.0).abs() < 1e-9 && way.turn.abs() < 1e-9, "{way:?}");
    }
}
