//! What all pages have in common: the head, the data, and the scripts that draw it.

use serde::Serialize;

use super::scene_data::in_script;
use super::text::fill;
use crate::{Error, Result};

/// The script of the 3D view.
pub const SCENE3D: &str = concat!(include_str!("marks.js"), include_str!("scene3d.js"));
/// The script that draws trained splats.
pub const SPLATS: &str = include_str!("splats.js");

/// A page. Texts are HTML.
pub struct Document<'d> {
    /// Kind of page, for styles.
    pub kind: &'d str,
    /// Whether it shows pictures that are files beside it.
    pub pictures: bool,
    /// Seconds after which it is loaded again.
    pub refresh: Option<u32>,
    /// Title of the window.
    pub title: &'d str,
    /// Styles of its own.
    pub style: &'d str,
    /// What stands above all.
    pub heading: &'d str,
    /// The sections.
    pub body: &'d str,
    /// Scripts of its own, which define what `draw` names.
    pub scripts: &'d [&'d str],
    /// Functions, separated by commas, that draw the data.
    pub draw: &'d str,
}

impl Document<'_> {
    /// The page with its data, self-contained.
    ///
    /// # Errors
    /// [`Error::Request`] where the data cannot be written as JSON.
    pub fn html(&self, data: &impl Serialize) -> Result<String> {
        let data = serde_json::to_string(data).map_err(|e| Error::request(format!("the report's data: {e}")))?;
        let data = in_script(&data);
        let common = [
            include_str!("charts.js"),
            include_str!("vectors.js"),
            include_str!("views.js"),
            include_str!("webgl.js"),
            include_str!("fault.js"),
        ];
        Ok(fill(include_str!("document.html"), |slot| match slot {
            "kind" => self.kind.into(),
            "pictures" if self.pictures => "data: file: 'self'".into(),
            "pictures" => "data:".into(),
            "refresh" => self.refresh.map_or_else(String::new, refresh).into(),
            "title" => self.title.into(),
            "style" => (include_str!("page.css").to_owned() + self.style).into(),
            "heading" => self.heading.trim_end().into(),
            "body" => self.body.into(),
            "data" => data.as_str().into(),
            "scripts" => [&common[..], self.scripts].concat().concat().into(),
            "draw" => format!("drawPage({});", self.draw).into(),
            _ => "".into(),
        }))
    }
}

fn refresh(seconds: u32) -> String {
    format!("<meta http-equiv=\"refresh\" content=\"{seconds}\">\n")
}
