//! The shot list: for each planned camera what it should see, and how to get there from a photo that exists.

use std::fmt::Write as _;

use serde::Serialize;

use super::pictures::{MAX_BYTES, jpeg, jpeg_url};
use super::shot_map::{self, Places};
use super::text::escape;
use super::way::{self, Way};
use crate::files::io::picture::stem;
use crate::files::photos::PhotoSet;
use crate::files::photos::preview::{Previews, unseen};
use crate::scene::camera::Camera;
use crate::scene::directions::Unit;
use crate::scene::region::Region;
use crate::{Error, Result};

/// Part of a picture that is new from which on that is said: a shot that looks beside an object is for what lies behind it in other views.
const MOSTLY: f64 = 0.5;
/// Qualities of pictures that are tried until all fit the page.
const QUALITIES: [u8; 4] = [80, 65, 50, 35];

/// A photo to take.
#[derive(Clone, Debug, Serialize)]
pub struct Shot {
    /// Name of the camera.
    pub name: String,
    /// File of what it should see, beside this list.
    pub picture: String,
    /// How to get there.
    #[serde(flatten)]
    pub way: Way,
    /// Share of it that no photo nearby shows.
    pub unseen: f64,
}

impl Shot {
    /// Whether most of it is in no photo nearby.
    pub fn is_new(&self) -> bool {
        self.unseen > MOSTLY
    }
}

/// What `shots.json` holds.
#[derive(Clone, Debug, Serialize)]
pub struct ShotList {
    /// What lengths in words are said in.
    pub unit: String,
    /// Its length in units of the scene.
    pub unit_length: f64,
    /// The shots, in the order of the tour.
    pub shots: Vec<Shot>,
}

/// The shot list of a plan, and what the page and the folder show of it.
pub struct Shots {
    /// The list.
    pub list: ShotList,
    /// What lengths are said in.
    pub unit: Unit,
    /// JPEG files of what each shot should see.
    pub pictures: Vec<Vec<u8>>,
    /// Of photos that exist and are shown: index among all cameras, and file.
    shown: Vec<(usize, Vec<u8>)>,
    /// Index of the photo to start from of each shot, among all cameras.
    from: Vec<usize>,
    /// The scene from above, as SVG.
    map: String,
}

impl Shots {
    /// Of planned cameras and the `kept` last ones, photos of `set`; none where none of these has an image, or none is planned.
    ///
    /// # Errors
    /// Where an image cannot be read.
    pub fn new(cameras: &[Camera], kept: usize, region: &Region, set: &PhotoSet) -> Result<Option<Self>> {
        let (planned, kept) = cameras.split_at(cameras.len() - kept);
        let number = |name: &str| kept.iter().position(|camera| camera.name == name);
        let there = set.photos.iter().any(|photo| photo.image.is_some() && number(&photo.camera.name).is_some());
        if planned.is_empty() || !there {
            return Ok(None);
        }
        let set = set.clone().filtered(|photo| number(&photo.camera.name).is_some());
        let (unit, said) = way::unit(&set, region.up);
        let previews = Previews::new(&set);
        let (pictures, photos) = previews.pictures(planned)?;
        let (mut shots, mut from) = (Vec::new(), Vec::new());
        for (i, camera) in planned.iter().enumerate() {
            // There is one, since there are photos with an image.
            let Some(nearest) = previews.nearest(camera).first().copied() else { return Ok(None) };
            let photo = &set.photos[nearest].camera;
            from.push(planned.len() + number(&photo.name).unwrap_or_default());
            shots.push(Shot {
                name: camera.name.clone(),
                picture: format!("shots/{:03}.jpg", i + 1),
                way: Way::new(photo, camera, region, &unit),
                unseen: unseen(&pictures[i]),
            });
        }
        let index = |photo: usize| planned.len() + number(&set.photos[photo].camera.name).unwrap_or_default();
        let mut photos: Vec<_> = photos.into_iter().map(|(photo, picture)| (index(photo), picture)).collect();
        photos.sort_by_key(|(photo, _)| *photo);
        let mut files = (Vec::new(), Vec::new());
        for quality in QUALITIES {
            files.0 = pictures.iter().map(|picture| jpeg(picture, quality)).collect::<Result<Vec<_>>>()?;
            files.1 = photos.iter().map(|(_, picture)| jpeg(picture, quality)).collect::<Result<Vec<_>>>()?;
            // A photo to start from is on the page with each of its shots.
            let again = from.iter().filter_map(|from| photos.iter().position(|(photo, _)| photo == from));
            let bytes: usize =
                files.0.iter().chain(&files.1).map(Vec::len).chain(again.map(|photo| files.1[photo].len())).sum();
            if bytes <= MAX_BYTES {
                break;
            }
        }
        let dots = shot_map::coloured(&set.points);
        let map = shot_map::svg(&Places { planned, kept, up: region.up }, &dots, &from, &unit);
        let list = ShotList { unit: said, unit_length: unit.length(), shots };
        let shown = photos.into_iter().map(|(photo, _)| photo).zip(files.1).collect();
        Ok(Some(Self { list, unit, pictures: files.0, shown, from, map }))
    }

    /// The small picture of the photo to start from of a shot, by its number from 0, as a JPEG file.
    pub fn start(&self, shot: usize) -> Option<&[u8]> {
        let from = self.from.get(shot)?;
        self.shown.iter().find(|(photo, _)| photo == from).map(|(_, file)| &file[..])
    }

    /// The photos to start from, one for each shot, by their index among all cameras.
    pub fn starts(&self) -> &[usize] {
        &self.from
    }

    /// `shots.json`.
    ///
    /// # Errors
    /// Where it cannot be encoded.
    pub fn json(&self) -> Result<String> {
        serde_json::to_string_pretty(&self.list)
            .map_err(|e| Error::request(format!("shots.json cannot be written: {e}")))
    }

    /// The section of the page.
    pub fn html(&self, cameras: &[Camera]) -> String {
        let metric = matches!(self.unit, Unit::Metre(_));
        let unit = if metric { String::new() } else { format!(" Lengths are in steps: {}.", escape(&self.list.unit)) };
        let mut html = format!(
            "<section aria-labelledby=\"shots-title\">\n<h2 id=\"shots-title\">Shot list</h2>\n<p>Stand where the photo on the right was \
             taken; move, left, right and forward as one looks in that photo and level; turn from where it looks and aim above or below the \
             horizon, until the viewfinder shows the picture on the left. That is made of photos nearby: edges may be frayed, and grey is what \
             none of them shows; a shot that is mostly grey is for surroundings that views of the object have behind it. Off by a few \
             hundredths of the distance to what you photograph is near enough.{unit}</p>\n{}<ol class=\"shots\">\n",
            self.map
        );
        for ((i, shot), (picture, from)) in self.list.shots.iter().enumerate().zip(self.pictures.iter().zip(&self.from))
        {
            let photo = self.start(i).map(jpeg_url);
            let height = shot.way.height.map(|height| {
                let (length, unit) = (height / self.list.unit_length, if metric { "m" } else { "steps" });
                format!(" The lens is {length:.1} {unit} above the floor.")
            });
            let new = if shot.is_new() { " Most of this no photo nearby shows yet." } else { "" };
            let _ = write!(
                html,
                "<li><div class=\"pair\"><figure data-camera=\"{i}\"><img src=\"{}\" alt=\"what shot {} should show\"></figure>\
                 <figure data-camera=\"{from}\"><img src=\"{}\" alt=\"photo {}\"></figure></div>\n<p><strong>{}</strong> From <b>{}</b>: {}.{}{new}</p></li>\n",
                jpeg_url(picture),
                i + 1,
                photo.unwrap_or_default(),
                escape(&shot.way.from),
                i + 1,
                escape(&shot.way.from),
                escape(&shot.way.words),
                height.unwrap_or_default()
            );
        }
        html += "</ol>\n";
        html += &registering(&self.list.shots);
        // Those that are not in the list, for looking through their cameras.
        let others = self.shown.iter().filter(|(photo, _)| !self.from.contains(photo) && *photo < cameras.len());
        html += "<div hidden>\n";
        for (photo, file) in others {
            let _ =
                writeln!(html, "<figure data-camera=\"{photo}\"><img src=\"{}\" alt=\"\"></figure>", jpeg_url(file));
        }
        html + "</div>\n</section>\n"
    }
}

/// What to do with the new photos.
fn registering(shots: &[Shot]) -> String {
    let stem = shots.first().and_then(|shot| stem(&shot.name)).unwrap_or_default();
    format!(
        "<details><summary>Afterwards: register the new photos with the old</summary>\n<p>Put them into the capture's folder of images, under \
         names that are not taken, such as {}_new.jpg. Where COLMAP's database of the capture is left, their poses come out in its frame:</p>\n\
         <pre>colmap feature_extractor --database_path database.db --image_path images\ncolmap exhaustive_matcher --database_path database.db\n\
         colmap image_registrator --database_path database.db --input_path sparse/0 --output_path sparse/1\n\
         colmap bundle_adjuster --input_path sparse/1 --output_path sparse/1</pre>\n<p>Where it is not, all photos are posed anew, in another \
         frame:</p>\n<pre>colmap automatic_reconstructor --workspace_path . --image_path images</pre>\n</details>\n",
        escape(&stem)
    )
}
