//! `--subject`: what of a surface is to be seen.

use std::path::{Path, PathBuf};

use glam::DVec3;

use super::options::numbers;
use crate::files::io::volume::{closed, read_faces};
use crate::scene::proxy::{Orientation, Proxy};
use crate::scene::subject::{MOST, largest, shared_faces};
use crate::scene::surface::Surface;
use crate::scene::volume::{Volume, box_triangles};
use crate::{Error, Result};

/// What is to be seen.
#[derive(Clone, Debug, PartialEq)]
pub enum SubjectOption {
    /// The largest thing that stands on the ground.
    Largest,
    /// What is in a box.
    Box(DVec3, DVec3),
    /// What is in a volume, or a mesh that is a part of the surface.
    File(PathBuf),
}

/// Reads the option.
pub fn parse_subject(text: &str) -> Result<SubjectOption, String> {
    if text == "largest" {
        return Ok(SubjectOption::Largest);
    }
    match numbers::<6>(text, "six numbers") {
        Ok([x0, y0, z0, x1, y1, z1]) => Ok(SubjectOption::Box(DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1))),
        Err(_) if Path::new(text).extension().is_some() => Ok(SubjectOption::File(text.into())),
        Err(_) => Err("give a box X0,Y0,Z0,X1,Y1,Z1, a file, or largest".into()),
    }
}

/// The volume of what is to be seen, and the height along up of what it stands on, if that is known.
///
/// # Errors
/// Where a file holds neither a volume nor a part of the surface, or nothing stands on anything.
pub fn subject_of(subject: &SubjectOption, surface: &Surface, up: DVec3) -> Result<(Volume, Option<f64>)> {
    let volume = match subject {
        SubjectOption::Largest => return largest(&Proxy::new(surface, Orientation::Trusted)?, up),
        SubjectOption::Box(min, max) if min.cmplt(*max).all() => {
            Volume { triangles: box_triangles(*min, *max), ..Volume::default() }
        }
        SubjectOption::Box(..) => {
            return Err(Error::request("--subject: give the lower corner of the box, then the higher one"));
        }
        SubjectOption::File(file) => {
            let faces = read_faces(file)?;
            let shared = match surface {
                Surface::Mesh(mesh) => {
                    shared_faces(&faces, mesh.triangles.iter().map(|t| t.map(|v| mesh.positions[v as usize])))
                }
                Surface::Points(_) => 0.0,
            };
            match closed(faces.clone()) {
                Ok(volume) => volume,
                Err(_) if shared >= MOST => faces,
                Err(error) if shared == 0.0 => return Err(error),
                Err(_) => {
                    let what = format!(
                        "it is neither closed nor a part of the surface, of which it has only {:.0}% of its faces; export both from one scene",
                        100.0 * shared
                    );
                    return Err(Error::input(file, what));
                }
            }
        }
    };
    let bottom = volume.triangles.iter().flatten().map(|p| p.dot(up)).fold(f64::INFINITY, f64::min);
    Ok((volume, Some(bottom)))
}
