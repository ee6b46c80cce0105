//! How far the picture has moved since the start of a walk.
//!
//! Adding up the motion from frame to frame would add up the trembling of hands and the errors of the measurement too. Motion
//! is therefore measured from a key frame, which moves on when the picture has moved by [`RENEW`], and travel is the furthest
//! reached so: trembling about a place adds nothing.

use super::motion::{Pyramid, between};

/// Motion from which the current frame becomes the key frame.
const RENEW: f64 = 0.06;
/// What a step counts that cannot be measured, between two frames with texture: as much as SfM may still connect. What it was in truth
/// is unknown; that it was more than nothing is not.
pub const LOST: f64 = 0.3;

/// What [`Traveller::next`] found of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Motion since the first frame, in shares of the picture; never less than that of the frame before.
    pub travel: f64,
    /// Whether the motion from an earlier frame to this one was measured.
    pub followed: bool,
}

/// Follows a walk frame by frame; it keeps two frames.
#[derive(Debug, Default)]
pub struct Traveller {
    /// The key frame and the frame before, with the travel of each.
    key: Option<(Pyramid, f64)>,
    last: Option<(Pyramid, f64)>,
    travel: f64,
    /// Whether frames without texture have gone by since the last that was followed.
    blind: bool,
}

impl Traveller {
    /// Takes the next frame.
    pub fn next(&mut self, frame: Pyramid) -> Step {
        let Some((key, at_key)) = &self.key else {
            // A walk begins with its first frame that shows something.
            let has_texture = frame.has_texture();
            if has_texture {
                self.key = Some((frame, self.travel));
            }
            return Step { travel: self.travel, followed: has_texture && !self.blind };
        };
        if !frame.has_texture() {
            self.blind = true;
            return Step { travel: self.travel, followed: false };
        }
        let reached = between(key, &frame).map(|motion| (motion, at_key + motion)).or_else(|| {
            let (last, at_last) = self.last.as_ref().filter(|_| !self.blind)?;
            // Far from the key frame: whatever is measured from the last one on, that has to be the next key.
            between(last, &frame).map(|motion| (motion.max(RENEW), at_last + motion))
        });
        let followed = reached.is_some();
        let (motion, reached) = reached.unwrap_or((RENEW, self.travel + LOST));
        self.travel = self.travel.max(reached);
        self.blind = false;
        if motion >= RENEW {
            self.key = Some((frame.clone(), reached));
        }
        self.last = Some((frame, reached));
        Step { travel: self.travel, followed }
    }
}

#[cfg(test)]
mod tests {
    use super::super::grey::Grey;
    use super::super::grey::fixtures::{picture, view};
    use super::*;

    const SIZE: [usize; 2] = [160, 90];

    fn steps(frames: impl IntoIterator<Item = Grey>) -> Vec<Step> {
        let mut traveller = Traveller::default();
        frames.into_iter().map(|frame| traveller.next(Pyramid::new(&frame))).collect()
    }

    /// If this failed, long walks would gather errors, and frames far into them would not be where they seem.
    #[test]
    fn travel_adds_up_to_the_true_path() {
        let found = steps((0..60).map(|i| view(SIZE, 1.7 * f64::from(i), 0.0, 0.0)));
        for (i, step) in found.iter().enumerate() {
            let known = 1.7 * i as f64 / 160.0;
            assert!(step.followed && (step.travel - known).abs() < 0.01 + 0.02 * known, "{i}: {step:?}, not {known}");
        }
    }

    /// If this failed, a pause with a camera held by hand would count as a walk and be given frames.
    #[test]
    fn trembling_leads_nowhere() {
        let found = steps((0..80).map(|i| {
            let (x, y) = ((0.9 * f64::from(i)).sin(), (1.3 * f64::from(i)).cos());
            view(SIZE, 1.5 * x, y, 0.0)
        }));
        let end = found.last().unwrap().travel;
        assert!(end < 0.03, "{end} of the picture after trembling by a hundredth to each side");
    }

    /// If this failed, a cut would count as no motion, and the frames after it would be left out as duplicates.
    #[test]
    fn cuts_are_steps_that_were_not_followed() {
        let found = steps([view(SIZE, 0.0, 0.0, 0.0), view(SIZE, 9000.0, 0.0, 0.0), view(SIZE, 9004.0, 0.0, 0.0)]);
        assert_eq!(found[1], Step { travel: LOST, followed: false });
        assert!(found[2].followed && (found[2].travel - LOST - 4.0 / 160.0).abs() < 0.003, "{found:?}");
    }

    /// If this failed, frames of a plain wall would be taken for a long way, or the way behind it for none.
    #[test]
    fn plain_frames_lead_nowhere_and_what_follows_them_is_found_again() {
        let wall = || picture(SIZE, 1.0, 3, |_, _| 120.0);
        let found = steps([view(SIZE, 0.0, 0.0, 0.0), wall(), wall(), view(SIZE, 5.0, 0.0, 0.0)]);
        assert!(!found[1].followed && !found[2].followed && found[2].travel == 0.0);
        assert!(found[3].followed && (found[3].travel - 5.0 / 160.0).abs() < 0.003, "{found:?}");
        let elsewhere = steps([view(SIZE, 0.0, 0.0, 0.0), wall(), view(SIZE, 5000.0, 0.0, 0.0)]);
        assert_eq!(elsewhere[2], Step { travel: LOST, followed: false });
        // Black before the start is no part of the walk.
        let begun = steps([wall(), view(SIZE, 0.0, 0.0, 0.0), view(SIZE, 3.0, 0.0, 0.0)]);
        assert!(begun[1].followed && begun[2].followed && begun[1].travel == 0.0, "{begun:?}");
    }
}
