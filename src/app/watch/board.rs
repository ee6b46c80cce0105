//! What the photographer sees: how far the capture is, what is wrong with photos, and where to stand next.

use std::sync::{Mutex, PoisonError};

use serde::Serialize;

use super::sfm;
use crate::app::report::pictures::jpeg_url;
use crate::app::report::shot_map::{self, Dot, Places};
use crate::app::report::shots::Shots;
use crate::files::photos::PhotoSet;
use crate::planner::plan::enough::{Advice, Enough};
use crate::planner::quality::law::Law;
use crate::planner::quality::map::colour_of;
use crate::scene::camera::Camera;
use crate::scene::region::{Region, Shape};
use crate::{Error, Result};

/// Fill of what no photo shows; the page defines it.
const UNSEEN: &str = "url(#unseen)";

/// How far the capture is.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Board {
    /// Rises with each change.
    version: u64,
    /// Name of the folder.
    pub title: String,
    /// What is being done.
    pub stage: String,
    /// Whether the advice is of all photos that there are.
    pub current: bool,
    /// Photos in the folder.
    pub photos: usize,
    /// Of these, photos that have a pose.
    pub posed: usize,
    /// Photos of no use, with the reason, the last one first.
    pub flaws: Vec<Flaw>,
    /// What went wrong, where something did.
    pub fault: Option<String>,
    /// What to do next; none before there is any.
    pub advice: Option<Shown>,
}

/// A photo of no use.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Flaw {
    /// Its name.
    pub name: String,
    /// Why.
    pub why: String,
}

/// Advice as it is shown.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Shown {
    /// Photos that it is about.
    pub photos: usize,
    /// "yes", "nearly" or "not yet".
    pub enough: &'static str,
    /// What further photos are expected to gain, in words.
    pub gain: String,
    /// What no photo shows, in words.
    pub hidden: String,
    /// Decibels that further photos are expected to gain, and the standard deviation of that.
    pub gain_db: f64,
    /// See `gain_db`.
    pub gain_sd_db: f64,
    /// Share of what viewers look at that no photo shows.
    pub unseen: f64,
    /// Weak parts, in words.
    pub weak: Vec<String>,
    /// What kind of scene it is taken for, "object" or "room"; empty where that was said.
    pub kind: &'static str,
    /// What was understood of the photos, and left out, a line each.
    pub notes: Vec<String>,
    /// What lengths are said in.
    pub unit: String,
    /// Where to stand next, the nearest first.
    pub next: Vec<Place>,
    /// The scene from above, as SVG.
    pub map: String,
}

/// A place to take a photo from.
#[derive(Clone, Debug, Serialize)]
pub struct Place {
    /// The photo to start from.
    pub from: String,
    /// How to get there.
    pub words: String,
    /// What the photo should show, as a data URL.
    pub picture: String,
    /// Whether most of that is in no photo yet.
    pub new: bool,
    /// The photo to start from, as a data URL.
    pub start: String,
}

impl Shown {
    /// Of advice on `photos`; `next` are those of its places that are shown, in their order; `said` is whether the user has said what kind of
    /// scene it is. None where no photo has an image.
    ///
    /// # Errors
    /// Where an image cannot be read.
    pub fn new(
        advice: &Advice,
        next: &[Camera],
        photos: &PhotoSet,
        region: &Region,
        said: bool,
    ) -> Result<Option<Self>> {
        let kept = photos.cameras();
        let all: Vec<Camera> = next.iter().chain(&kept).cloned().collect();
        let Some(shots) = Shots::new(&all, kept.len(), region, photos)? else { return Ok(None) };
        let places = shots.list.shots.iter().enumerate().map(|(i, shot)| Place {
            from: shot.way.from.clone(),
            words: shot.way.words.clone(),
            picture: jpeg_url(&shots.pictures[i]),
            new: shot.is_new(),
            start: shots.start(i).map(jpeg_url).unwrap_or_default(),
        });
        let law = Law::embedded(matches!(region.shape, Shape::Shell { .. }));
        let fill = |(error, unseen): (&f32, &bool)| match unseen {
            true => UNSEEN.into(),
            false => {
                let [r, g, b] = colour_of(f64::from(*error), &law);
                format!("#{r:02x}{g:02x}{b:02x}")
            }
        };
        let fills = advice.errors.iter().zip(&advice.unseen).map(fill);
        let dots: Vec<Dot> =
            advice.points.iter().zip(fills).map(|(position, fill)| Dot { position: *position, fill }).collect();
        let map =
            shot_map::svg(&Places { planned: next, kept: &kept, up: region.up }, &dots, shots.starts(), &shots.unit);
        let kind = match region.shape {
            _ if said => "",
            Shape::Shell { .. } => "object",
            Shape::Box { .. } => "room",
        };
        let Enough { more, gain_db, gain_sd_db, unseen, .. } = advice.enough;
        Ok(Some(Self {
            photos: kept.len(),
            enough: advice.enough.answer(),
            gain: format!(
                "The {more} photos that help most would gain about {:.1} dB (standard deviation {gain_sd_db:.1}).",
                gain_db.max(0.0)
            ),
            hidden: format!("{:.0}% of what people will look at is in no photo.", 100.0 * unseen),
            gain_db,
            gain_sd_db,
            unseen,
            weak: advice.enough.weak.iter().map(|weak| weak.line()).collect(),
            kind,
            notes: Vec::new(),
            unit: shots.list.unit.clone(),
            next: places.collect(),
            map,
        }))
    }
}

impl Shown {
    /// The same of places that are at no wider an angle from photos than [`sfm::connected`] says, where structure from motion is to join them.
    /// What is in reach where photos were lost gains little whatever is missing: then photos are not enough.
    pub fn within(self, degrees: Option<f32>) -> Self {
        let [widest, narrowest] = sfm::CONNECTED;
        match degrees {
            Some(degrees) if degrees < 0.5 * (widest + narrowest) => {
                let hidden = format!("{} Most of the last photos could not be placed.", self.hidden);
                Self { enough: "not yet", hidden, ..self }
            }
            Some(degrees) if degrees < widest && self.enough == "yes" => Self { enough: "nearly", ..self },
            _ => self,
        }
    }
}

/// A board that several threads write and read.
#[derive(Default)]
pub struct Shared(Mutex<Board>);

impl Shared {
    /// Changes what is shown.
    pub fn change(&self, change: impl FnOnce(&mut Board)) {
        // What one thread left half changed is shown until the next change.
        let mut board = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut board);
        board.version += 1;
    }

    /// The board as JSON, or its version alone for who has that already.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn json(&self, had: Option<u64>) -> Result<String> {
        let board = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let text = match had == Some(board.version) {
            true => serde_json::to_string(&serde_json::json!({ "version": board.version })),
            false => serde_json::to_string(&*board),
        };
        text.map_err(|e| Error::request(format!("the page's data cannot be written: {e}")))
    }
}

/// The page, which asks for the board every second or two.
pub const PAGE: &str = concat!(
    include_str!("head.html"),
    "<style>",
    include_str!("page.css"),
    "</style>",
    include_str!("body.html"),
    "<script>",
    include_str!("page.js"),
    "</script>\n"
);

#[cfg(test)]
mod tests {
    use super::*;

    /// If this failed, a photographer whose photos are lost one after another would be sent home, since nothing in reach gains much.
    #[test]
    fn photos_are_not_enough_where_the_last_were_lost() {
        let of = |degrees: Option<f32>| {
            let Shown { enough, hidden, .. } = Shown { enough: "yes", ..Shown::default() }.within(degrees);
            (enough, hidden.contains("could not be placed"))
        };
        let connected = |lost: usize| Some(sfm::connected((0..10).map(|photo| photo >= lost)));
        assert_eq!([None, connected(0)].map(of), [("yes", false); 2]);
        assert_eq!([connected(1), connected(5)].map(of), [("nearly", false); 2]);
        assert_eq!([connected(6), connected(10)].map(of), [("not yet", true); 2]);
    }
}
