//! The option of where the trained model will be viewed from.

use std::path::Path;

use clap::Args;
use glam::DVec3;

use super::options::read_cameras;
use super::region::box_of;
use crate::planner::quality::viewers::Viewers;
use crate::scene::region::Shape;
use crate::{Error, Result};

/// From where people will look.
#[derive(Args, Clone, Debug, Default)]
pub struct ViewerOptions {
    /// Where the trained model will be viewed from: shell:CX,CY,CZ,RMIN,RMAX; box:X0,Y0,Z0,X1,Y1,Z1; cone:DEGREES,X,Y,Z, the default
    /// within a cone around this direction; heights:LOW,HIGH, the default between these; or a file or folder of cameras [default:
    /// around an object, between half of the region's outer radius and all of it; in rooms, anywhere; with `select`, where the photos
    /// were taken]
    #[arg(long, value_name = "VIEWERS", allow_hyphen_values = true)]
    viewers: Option<String>,
}

impl ViewerOptions {
    /// The viewers, those by default where none are given.
    ///
    /// # Errors
    /// As [`ViewerOptions::given`].
    pub fn viewers(&self) -> Result<Viewers> {
        Ok(self.given()?.unwrap_or_default())
    }

    /// The viewers that are given.
    ///
    /// # Errors
    /// Where there are too many or too few numbers, or no cameras.
    pub fn given(&self) -> Result<Option<Viewers>> {
        self.viewers.as_deref().map(Self::parse).transpose()
    }

    fn parse(text: &str) -> Result<Viewers> {
        let forms = [
            ("shell", "CX,CY,CZ,RMIN,RMAX"),
            ("box", "X0,Y0,Z0,X1,Y1,Z1"),
            ("cone", "DEGREES,X,Y,Z"),
            ("heights", "LOW,HIGH"),
        ];
        let named =
            forms.iter().find_map(|(kind, form)| Some((*kind, *form, text.strip_prefix(kind)?.strip_prefix(':')?)));
        let Some((kind, form, numbers)) = named else {
            return Ok(Viewers::Cameras(read_cameras(Path::new(text))?));
        };
        let read: Result<Vec<f64>, _> = numbers.split(',').map(|number| number.trim().parse()).collect();
        let wrong = || Error::request(format!("--viewers {text}: give {kind}:{form}"));
        let numbers = read.map_err(|_| wrong())?;
        if numbers.iter().any(|number| !number.is_finite()) {
            return Err(wrong());
        }
        match (kind, &numbers[..]) {
            ("shell", &[x, y, z, r_min, r_max]) if 0.0 < r_min && r_min <= r_max => {
                Ok(Viewers::Shell { centre: DVec3::new(x, y, z), r_min, r_max })
            }
            ("box", numbers) => match box_of(numbers).map_err(|_| wrong())? {
                Shape::Box { min, max } if min.cmple(max).all() => Ok(Viewers::Box { min, max }),
                _ => Err(wrong()),
            },
            ("cone", &[degrees, x, y, z]) if degrees > 0.0 && DVec3::new(x, y, z) != DVec3::ZERO => {
                Ok(Viewers::Cone { axis: DVec3::new(x, y, z), degrees })
            }
            ("heights", &[low, high]) if low <= high => Ok(Viewers::Heights { low, high }),
            _ => Err(wrong()),
        }
    }
}
